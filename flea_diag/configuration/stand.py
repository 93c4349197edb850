# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A stand: the folder whose ``stand.yaml`` names all that a diagnosis rests on."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

from flea_diag.configuration.files import (
    DEFAULT_STAND,
    STANDS,
    config_folders,
    found_file,
    given_file,
    is_bare,
    load_yaml,
    text_of,
)
from flea_diag.core.vibration.bearing_frequencies import Kinematics
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.formats import migrated

STAND_FILE = "stand.yaml"
FILES = ("actuator", "faults", "calibration", "features")
"""Keys of ``stand.yaml`` that name files: description, fault catalogue, calibration, and fault
feature table."""
CHANNELS = "channels"
"""Key of the file that says where channels come from, for stands whose recordings are imported."""


@dataclass(frozen=True)
class _StandFile:
    name: str
    actuator: str
    faults: str
    calibration: str
    features: str
    channels: str = ""
    kinematics: Kinematics = field(default_factory=Kinematics)


@dataclass(frozen=True)
class Stand:
    """A stand and its files, which need not exist before they are read.

    Parameters
    ----------
    name
        For people and logs.
    folder
        Where its ``stand.yaml`` is, as an absolute path.
    actuator
        Description of the actuator as a bond graph.
    faults
        Fault catalogue.
    calibration
        Parameters, noise and limits from nominal recordings.
    features
        Fault feature table.
    channels
        Where its channels come from; None where it sends them itself.
    kinematics
        What rolls and meshes in its drive, from which lines of vibration follow.
    """

    name: str
    folder: Path
    actuator: Path
    faults: Path
    calibration: Path
    features: Path
    channels: Path | None = None
    kinematics: Kinematics = field(default_factory=Kinematics)

    def texts(self) -> dict[str, str]:
        """Name of each file -> its text, to be stored in a recording.

        Raises
        ------
        ConfigurationError
            A file does not exist, cannot be read or is too large.
        """
        paths = {STAND_FILE: self.folder / STAND_FILE}
        paths |= {f"{key}.yaml": getattr(self, key) for key in FILES}
        if self.channels is not None:
            paths[f"{CHANNELS}.yaml"] = self.channels
        return {name: text_of(found_file(path)) for name, path in paths.items()}


def load_stand(name_or_folder: str | Path = "", **given: str | Path | None) -> Stand:
    """A stand by the name of a shipped one or by its folder; empty: the shipped FLEA.

    Parameters
    ----------
    name_or_folder
        A bare name is that of a shipped stand, a folder has a separator (``./mine``).
    **given
        Files that replace those of the stand, by their keys; empty or None: the stand's own.

    Raises
    ------
    ConfigurationError
        There is no such stand, or its ``stand.yaml`` is refused.
    """
    folder = _folder(str(name_or_folder) or DEFAULT_STAND)
    own = stand_from_mapping(load_yaml(folder / STAND_FILE), folder)
    paths: dict[str, Any] = {key: given_file(file) for key, file in given.items() if file}
    return replace(own, **paths)


def stand_from_mapping(content: object, folder: Path) -> Stand:
    """Stand from the content of the ``stand.yaml`` in a folder; see ``load_stand``."""
    where = str(folder / STAND_FILE)
    known = read_as(_StandFile, migrated("stand", content, where), where)
    if not known.name.strip() or not known.name.isprintable():
        raise ConfigurationError(f"{where}: name = {shown(known.name)} is no name; give one")
    given = (*FILES, CHANNELS) if known.channels else FILES
    files = {key: folder / _inside(getattr(known, key), f"{where}: {key}") for key in given}
    return Stand(known.name, folder, **files, kinematics=known.kinematics)


def shipped_stands() -> dict[str, Path]:
    """Name of each shipped stand -> its folder."""
    found: dict[str, Path] = {}
    for folder in config_folders():
        for path in sorted(folder.glob(f"{STANDS}/*/{STAND_FILE}")):
            found.setdefault(path.parent.name, path.parent)
    return found


def _folder(text: str) -> Path:
    """Folder of a stand given by name or path."""
    if is_bare(text):
        return _shipped(text)
    folder = Path(text).absolute()
    said = f"stand {text!r}"
    if folder.is_file():
        raise ConfigurationError(f"{said} is a file, a stand is a folder: name that")
    if not folder.is_dir():
        raise ConfigurationError(f"{said}: no such folder")
    if not (folder / STAND_FILE).exists():
        raise ConfigurationError(
            f"{said} has no {STAND_FILE}: write one after "
            f"config/{STANDS}/{DEFAULT_STAND}/{STAND_FILE}"
        )
    return folder


def _shipped(name: str) -> Path:
    known = shipped_stands()
    if name not in known:
        here = "the folder here is" if Path(name).is_dir() else "a folder of your own is"
        raise ConfigurationError(
            f"stand {shown(name)} is not shipped, known are {', '.join(known) or 'none'}; "
            f"{here} ./{shown(name)[1:-1]}"
        )
    return known[name]


def _inside(name: str, where: str) -> str:
    """Name of a file inside the folder of its stand.

    A link is its owner's own: an installation with links has nothing else.
    """
    parts = PurePosixPath(name).parts
    if not parts or not name.isprintable():
        raise ConfigurationError(f"{where} = {shown(name)} is no name of a file; give one")
    if name.startswith(os.sep) or os.pardir in parts:
        raise ConfigurationError(
            f"{where} = {shown(name)} must lie inside the folder of the stand; copy the file there"
        )
    return name
