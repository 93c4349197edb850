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

"""Configuration files: where they are, and what is in them.

A bare name is that of a shipped file; a path has a separator. So no default ever takes a file of
the working directory. What a user types is read by ``given_file``: there a bare name is a file of
the working directory first, as for any command.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

from flea_diag.configuration.disk_cache import kept
from flea_diag.errors import ConfigurationError
from flea_diag.wire.regular_file import read_text
from flea_diag.wire.yaml_text import parse_yaml

LARGEST_YAML_BYTES = 1 << 20
PACKAGE = Path(__file__).resolve().parents[1]
STANDS = "stands"
"""Folder of the shipped stands, one folder each."""
DEFAULT_STAND = "flea"


def config_folders() -> tuple[Path, ...]:
    """Folders that may contain the shipped configuration, nearest first.

    The source tree of the package, the prefix of its installation, the prefixes of
    AMENT_PREFIX_PATH, the prefix of the Python environment.
    """
    share = Path("share", "flea_diag", "config")
    source = PACKAGE.parent
    found = [source / "config"] if (source / "package.xml").is_file() else []
    found += [parent / share for parent in PACKAGE.parents[:6]]
    found += [Path(p) / share for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
    return tuple(dict.fromkeys([*found, Path(sys.prefix) / share]))


def config_path(name: str) -> Path:
    """Path of a shipped file; those of the default stand need no folder in front.

    Raises
    ------
    ConfigurationError
        There is no such file; names the folders searched, and how to name a file that is here.
    """
    found = _shipped(name)
    if found is not None:
        return found
    if Path(name).exists():
        raise ConfigurationError(
            f"{name}: no such file is shipped; the file of the working directory is ./{name}"
        )
    places = ", ".join(str(folder) for folder in config_folders() if folder.is_dir()) or "none"
    raise ConfigurationError(
        f"{name}: no such configuration file (configuration folders found: {places})"
    )


def _shipped(name: str) -> Path | None:
    for folder in config_folders():
        for place in (folder, folder / STANDS / DEFAULT_STAND):
            if (place / name).exists():
                return place / name
    return None


def is_bare(name: str | Path) -> bool:
    """Whether this is a name alone, no path."""
    return os.sep not in str(name) and str(name) not in ("", os.curdir, os.pardir)


def found_file(name_or_path: str | Path) -> Path:
    """Path of a shipped file given by its name, or of any file given by its path.

    Raises
    ------
    ConfigurationError
        The file does not exist.
    """
    if is_bare(name_or_path):
        return config_path(str(name_or_path))
    path = Path(name_or_path)
    if path.is_dir() or not path.exists():
        raise ConfigurationError(f"{path}: no such file")
    return path


def given_file(text: str | Path) -> Path:
    """Path of a file that a user names; a bare name that is not here may be that of a shipped file.

    Whoever reads it says what is missing where it is neither, and how to make it.
    """
    path = Path(text)
    if is_bare(text) and not path.exists():
        return _shipped(str(text)) or path.absolute()
    return path.absolute() if is_bare(path) else path


def load_yaml(name_or_path: str | Path) -> Any:
    """Content of a YAML file, given by path or by the name of a shipped file.

    Raises
    ------
    ConfigurationError
        The file does not exist, is too large, or is not YAML.
    """
    path = found_file(name_or_path)
    return parsed(text_of(path), path)


def parsed(text: str, path: Path) -> Any:
    """Content of a YAML text; ``path`` is named where it is none."""
    try:
        return kept("yaml", (text,), partial(parse_yaml, text))
    except ValueError as error:
        raise ConfigurationError(f"{path}: not a YAML file: {error}") from error


def text_of(path: Path) -> str:
    """Text of a configuration file.

    Raises
    ------
    ConfigurationError
        It does not exist, cannot be read, or is too large.
    """
    try:
        return read_text(path, LARGEST_YAML_BYTES, ConfigurationError)
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
