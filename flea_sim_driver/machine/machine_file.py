"""Reads a machine from YAML. Every value is required, except of parts that it may lack."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from flea_diag.errors import ConfigurationError, shown
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
from flea_sim_driver.plant.quantity import ABOVE_ZERO
from flea_sim_driver.plant.structure import Mode, Structure, StructureSpread
from flea_sim_driver.plant.thermal import Heat
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.plant.vibration import Sources

S = TypeVar("S")
FILE_LIMIT_BYTES = 1 << 20
SECTIONS: dict[str, type] = {
    "unit": SimulatedUnit, "bench": Bench, "heat": Heat, "catches": Catches,
    "structure_spread": StructureSpread, "vibration": Sources, "sampling": Sampling,
    "limits": Limits, "drawn": DrawnMotion,
}  # fmt: skip
MAPPINGS = ("spread", "instruments", "faults", "sensor_faults", "structure")
PLAIN = ("name", "description")


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
    values = migrated("machine", content, where)
    unknown = sorted(set(values) - {*SECTIONS, *MAPPINGS, *PLAIN}, key=repr)
    if unknown:
        known = ", ".join((*PLAIN, *SECTIONS, *MAPPINGS))
        raise ConfigurationError(f"{where}: unknown key {shown(unknown[0])}, known are {known}")
    rows = {key: _mapping(values.get(key), f"{where}: {key}") for key in (*SECTIONS, *MAPPINGS)}
    made = {key: section(kind, rows[key], f"{where}: {key}") for key, kind in SECTIONS.items()}
    machine = Machine(
        **{key: _text(values.get(key), f"{where}: {key}") for key in PLAIN},
        **made,
        spread=_spread(rows["spread"], f"{where}: spread"),
        structure=_structure(rows["structure"], f"{where}: structure"),
        instruments=_instruments(rows["instruments"], f"{where}: instruments"),
        faults=rows["faults"],
        sensor_faults=rows["sensor_faults"],
    )
    _check_rates(machine.sampling, f"{where}: sampling")
    return machine


def section(kind: type[S], values: Mapping[str, Any], where: str) -> S:
    """A frozen dataclass of numbers, pairs and texts from a mapping.

    Raises
    ------
    ConfigurationError
        A key is unknown or missing, or a value has the wrong type or lies outside its bounds.
    """
    hints = get_type_hints(kind)
    known = {entry.name: entry for entry in fields(kind)}  # type: ignore[arg-type]
    for name in values:
        if name not in known:
            raise ConfigurationError(
                f"{where}: unknown value {shown(name)}, known are {', '.join(known)}"
            )
    made = {}
    for name, entry in known.items():
        if name in values:
            made[name] = _checked(values[name], hints[name], f"{where}: {name}")
            if entry.metadata.get(ABOVE_ZERO) and made[name] <= 0.0:
                raise ConfigurationError(f"{where}: {name} = {made[name]!r} must be above 0")
        elif entry.default is MISSING:
            raise ConfigurationError(f"{where}: {name} is missing; give its value")
    return kind(**made)


def _checked(value: Any, hint: Any, where: str) -> Any:
    if hint is str:
        return _text(value, where)
    if hint is float:
        return number(value, where)
    if not isinstance(value, list) or len(value) != len(hint.__args__):
        raise ConfigurationError(
            f"{where} = {shown(value)} must be a list of {len(hint.__args__)} numbers"
        )
    return tuple(number(each, where) for each in value)


def number(value: Any, where: str) -> float:
    """A finite number.

    Raises
    ------
    ConfigurationError
        It is none.
    """
    sound = isinstance(value, int | float) and not isinstance(value, bool)
    if not sound or not math.isfinite(value):
        raise ConfigurationError(f"{where} = {shown(value)} must be a finite number")
    return float(value)


def numbers_of(values: Any, names: tuple[str, ...], where: str) -> dict[str, float]:
    """These numbers of a mapping, which holds no others.

    Raises
    ------
    ConfigurationError
        One is missing, unknown or no number.
    """
    given = _mapping(values, where)
    for name in (*names, *given):
        if name not in given or name not in names:
            what = "is missing" if name in names else "is unknown"
            raise ConfigurationError(
                f"{where}: {shown(name)} {what}, there must be {', '.join(names)}"
            )
    return {name: number(given[name], f"{where}: {name}") for name in names}


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise ConfigurationError(f"{where} = {shown(value)} must be a line of text")
    return value


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ConfigurationError(f"{where} = {shown(value)} must be a mapping")
    return value


def _spread(values: Mapping[str, Any], where: str) -> dict[str, float]:
    """Relative standard deviations, in the order of the unit's parameters."""
    names = [entry.name for entry in fields(SimulatedUnit)]
    for name in values:
        if name not in names:
            raise ConfigurationError(
                f"{where}: a unit has no {shown(name)}, it has {', '.join(names)}"
            )
    made = {name: number(values[name], f"{where}: {name}") for name in names if name in values}
    for name, value in made.items():
        if not 0.0 <= value <= 1.0:
            raise ConfigurationError(f"{where}: {name} = {value!r} must lie between 0 and 1")
    return made


def _structure(values: Mapping[str, Any], where: str) -> Structure:
    """Resonances at motor housing and nut, each a list of frequency, damping and weight."""
    rows = []
    for place in ("motor", "nut"):
        modes = values.get(place)
        if not isinstance(modes, list) or not modes:
            raise ConfigurationError(f"{where}: {place} must be a list of resonances")
        rows.append(
            tuple(
                section(Mode, _mapping(mode, f"{where}: {place}"), f"{where}: {place}[{k}]")
                for k, mode in enumerate(modes)
            )
        )
    return Structure((rows[0], rows[1]))


def _instruments(values: Mapping[str, Any], where: str) -> tuple[Instrument, ...]:
    return tuple(
        section(
            Instrument,
            {"channel": channel, **_mapping(row, f"{where}: {channel}")},
            f"{where}: {channel}",
        )
        for channel, row in values.items()
    )


def _check_rates(sampling: Sampling, where: str) -> None:
    """A block holds whole scans, and a scan whole steps of the integration."""
    steps = sampling.scan_s / STEP_S
    if abs(sampling.scans - sampling.scan_rate_hz * BLOCK_S) > 1e-9 or abs(steps % 1.0) > 1e-9:
        raise ConfigurationError(
            f"{where}: scan_rate_hz = {sampling.scan_rate_hz!r} Hz must divide "
            f"{1.0 / STEP_S:g} Hz and be a multiple of {1.0 / BLOCK_S:g} Hz"
        )
