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

"""Reads a machine from YAML. Every value is required, except of parts that it may lack."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE, Share
from flea_diag.formats import migrated
from flea_diag.wire.regular_file import read_text
from flea_diag.wire.yaml_text import parse_yaml
from flea_sim_driver.machine.machine import (
    BLOCK_S,
    DrawnMotion,
    Instrument,
    Limits,
    Machine,
    Sampling,
)
from flea_sim_driver.plant.disturbance import Catches
from flea_sim_driver.plant.plant import STEP_S
from flea_sim_driver.plant.structure import Mode, Structure, StructureSpread
from flea_sim_driver.plant.thermal import Heat
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.plant.vibration import Sources

FILE_LIMIT_BYTES = 1 << 20


@dataclass(frozen=True)
class _Resonances:
    """Resonances at motor housing and nut."""

    motor: tuple[Mode, ...]
    nut: tuple[Mode, ...]

    def __post_init__(self) -> None:
        """Both have some."""
        if not self.motor or not self.nut:
            raise ValueError("motor and nut must be lists of resonances")


@dataclass(frozen=True)
class _MachineFile:
    """The whole file."""

    name: str
    description: str
    unit: SimulatedUnit
    bench: Bench
    heat: Heat
    catches: Catches
    structure_spread: StructureSpread
    vibration: Sources
    sampling: Sampling
    limits: Limits
    drawn: DrawnMotion
    spread: Mapping[str, Share]
    structure: _Resonances
    instruments: Mapping[str, Any]
    faults: Mapping[str, Mapping[str, Any]]
    sensor_faults: Mapping[str, Mapping[str, Any]]


def load_machine(path: Path) -> Machine:
    """Read and check one machine.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a value is missing, unknown or impossible.
    """
    try:
        content = parse_yaml(read_text(path, FILE_LIMIT_BYTES, ConfigurationError))
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error}") from error
    except ValueError as error:
        raise ConfigurationError(f"{path}: not valid YAML: {error}") from error
    return machine_from_mapping({} if content is None else content, str(path))


def machine_from_mapping(content: object, where: str) -> Machine:
    """Machine of the content of its file; see ``load_machine``."""
    known = read_as(_MachineFile, migrated("machine", content, where), where, magnitudes=FINITE)
    for key in ("name", "description"):
        if not getattr(known, key).isprintable():
            raise ConfigurationError(f"{where}: {key} must be a line of text")
    _check_rates(known.sampling, f"{where}: sampling")
    instruments = tuple(
        read_as(
            Instrument,
            row,
            f"{where}: instruments: {shown(channel)}",
            magnitudes=FINITE,
            given={"channel": channel},
        )
        for channel, row in known.instruments.items()
    )
    _check_instruments(instruments, known.sampling.scan_rate_hz, where)
    made = {
        "spread": _spread(known.spread, f"{where}: spread"),
        "structure": Structure((known.structure.motor, known.structure.nut)),
        "instruments": instruments,
    }
    return Machine(**{**vars(known), **made})


def _check_instruments(rows: tuple[Instrument, ...], scan_hz: float, where: str) -> None:
    """A slow instrument is read once in a whole number of scans."""
    for row in rows:
        every = scan_hz / row.rate_hz if row.rate_hz else 1.0
        if every < 1.0 or abs(every - round(every)) > 1e-6:
            raise ConfigurationError(
                f"{where}: instruments: {row.channel}: rate_hz = {row.rate_hz!r} must be that of "
                f"the scans, {scan_hz:g} Hz, over a whole number"
            )


def numbers_of(values: object, names: tuple[str, ...], where: str) -> dict[str, float]:
    """These numbers of a mapping, which holds no others.

    Raises
    ------
    ConfigurationError
        One is missing, unknown or no number.
    """
    given = read_as(dict[str, float], values, where, magnitudes=FINITE)
    for name in (*names, *given):
        if name not in given or name not in names:
            what = "is missing" if name in names else "is unknown"
            raise ConfigurationError(
                f"{where}: {shown(name)} {what}, there must be {', '.join(names)}"
            )
    return {name: given[name] for name in names}


def _spread(values: Mapping[str, float], where: str) -> dict[str, float]:
    """Relative standard deviations, in the order of the unit's parameters."""
    names = [entry.name for entry in fields(SimulatedUnit)]
    for name in values:
        if name not in names:
            raise ConfigurationError(
                f"{where}: a unit has no {shown(name)}, it has {', '.join(names)}"
            )
    return {name: values[name] for name in names if name in values}


def _check_rates(sampling: Sampling, where: str) -> None:
    """A block holds whole scans, and a scan whole steps of the integration."""
    steps = sampling.scan_s / STEP_S
    if abs(sampling.scans - sampling.scan_rate_hz * BLOCK_S) > 1e-9 or abs(steps % 1.0) > 1e-9:
        raise ConfigurationError(
            f"{where}: scan_rate_hz = {sampling.scan_rate_hz!r} Hz must divide "
            f"{1.0 / STEP_S:g} Hz and be a multiple of {1.0 / BLOCK_S:g} Hz"
        )
