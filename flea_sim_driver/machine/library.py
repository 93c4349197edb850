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

"""Finds machines, and the other files of the simulator: source tree or installation prefix."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from flea_diag.errors import ConfigurationError, shown
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.machine.machine_file import load_machine

DEFAULT_MACHINE = "flea"
INSTALLED = Path("share/flea_diag/config")
SUFFIXES = (".yaml", ".yml")


def config_folders(name: str) -> Iterator[Path]:
    """Places of one folder of the shipped configuration, nearest first."""
    yield Path(__file__).resolve().parents[2] / "config" / name
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / INSTALLED / name
    yield Path(sys.prefix) / INSTALLED / name
    # A prefix that is none of Python's own: .../lib/python3.x/site-packages/flea_sim_driver.
    for above in Path(__file__).resolve().parents:
        yield above / INSTALLED / name


def machine_names() -> tuple[str, ...]:
    """Names of the machines shipped with the package."""
    for folder in config_folders("machines"):
        if folder.is_dir():
            return tuple(sorted(path.stem for path in folder.glob("*.yaml")))
    return ()


def find_machine(name_or_path: str) -> Machine:
    """Machine by the name of a shipped one, or from a YAML file.

    Raises
    ------
    ConfigurationError
        No such file or name, or its content is refused.
    """
    path = Path(name_or_path)
    if path.suffix in SUFFIXES:
        return _loaded(path.absolute())
    for folder in config_folders("machines"):
        candidate = folder / f"{name_or_path}.yaml"
        if candidate.parent == folder and candidate.is_file():
            return _loaded(candidate)
    raise ConfigurationError(
        f"machine {shown(name_or_path)} is neither a YAML file nor one of "
        f"{', '.join(machine_names()) or 'the installed ones (none found)'}"
    )


@lru_cache(maxsize=8)
def _loaded(path: Path) -> Machine:
    return load_machine(path)
