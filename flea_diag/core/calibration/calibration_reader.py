"""Reader of a calibration in its mapping form: kind and bounds of every entry."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from typing import Any

from flea_diag.core.calibration.calibration import (
    LATER_PARAMETERS,
    SINCE_OUT_OF_SAMPLE,
    BadStretch,
    Calibration,
    CovarianceBlock,
)
from flea_diag.core.calibration.out_of_sample import GroupCoverage, LeftOut, OutOfSample
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit, WindowLimit
from flea_diag.core.observers.observer_noise import PROCESS, ObserverNoise
from flea_diag.core.residuals.leverage import CalibrationEnvelope, LeverageFit
from flea_diag.core.residuals.parameters import (
    UNIT_PARAMETERS,
    ActuatorParameters,
    UnitTolerance,
)
from flea_diag.core.residuals.residual_rows import WINDOWS
from flea_diag.core.sensors.sensor_limits import SensorLimit
from flea_diag.errors import CalibrationError, shown
from flea_diag.formats import migrated


def from_mapping(content: object, where: str) -> Calibration:
    """Calibration from its plain mapping.

    Raises
    ------
    CalibrationError
        An entry is missing, unknown, of the wrong type or not finite; ``where`` is named.
    """
    mapping = migrated("calibration", content, where)
    if mapping.get("speed_regions_m_s") != list(SPEED_REGIONS_M_S):
        raise CalibrationError(
            f"{where}: speed_regions_m_s = {shown(mapping.get('speed_regions_m_s'))}, this version "
            f"tests in {list(SPEED_REGIONS_M_S)!r}; repeat 'flea calibrate'"
        )
    known = {"speed_regions_m_s", *_READERS}
    for key in mapping:
        if key not in known:
            raise CalibrationError(
                f"{where}: unknown entry {shown(key)}, known are {sorted(known)}"
            )
    values: dict[str, Any] = {}
    for key, reader in _READERS.items():
        if key not in mapping and key in LATER:
            continue  # an older file: the default holds
        if key not in mapping:
            raise CalibrationError(f"{where}: entry {key!r} is missing")
        try:
            values[key] = reader(mapping[key])
        except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
            raise CalibrationError(f"{where}: {key}: {error}") from error
    return Calibration(**values)


def _number(value: Any) -> float:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or value != value or value in (math.inf, -math.inf):
        raise ValueError(f"{shown(value)} is not a finite number")
    if abs(value) > LARGEST:
        raise ValueError(f"{shown(value)} is beyond {LARGEST:g}; check its unit")
    return float(value)


def _positive(value: Any) -> float:
    return _within(value, LIKELY)


def _not_negative(value: Any) -> float:
    if _number(value) < 0.0:
        raise ValueError(f"{shown(value)} must not be below 0")
    return float(value)


def _within(value: Any, limits: tuple[float, float], name: str = "") -> float:
    said = f"{name} = {shown(value)}" if name else shown(value)
    if not _number(value) > 0.0:
        raise ValueError(f"{said} must be above 0")
    lowest, highest = limits
    if not lowest <= value <= highest:
        raise ValueError(f"{said} lies outside {lowest:g} to {highest:g}; check its unit")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > 10_000:
        raise ValueError(f"{shown(value)} is not a text")
    return value


def _sha256(value: Any) -> str:
    if _text(value) and not re.fullmatch("[0-9a-f]{64}", value):
        raise ValueError(f"{shown(value)} is no SHA-256 of 64 hexadecimal digits")
    return str(value)


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{shown(value)} is not a list")
    return value


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(_text(entry) for entry in _list(value))


def _numbers_of(
    kind: type,
    ranges: Mapping[str, tuple[float, float]],
    retired: Collection[str] = (),
    later: Collection[str] = (),
) -> Callable[[Any], Any]:
    """Reader of a dataclass of numbers; ``later`` ones may lack in an older file."""
    names = {entry.name for entry in fields(kind)}

    def read(value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise ValueError(f"{shown(value)} is no mapping")
        given = set(value) - set(retired)
        if odd := sorted(map(shown, (given ^ names) - (set(later) - given))):
            raise ValueError(f"{odd[0]} is missing or unknown")
        for key, limits in ranges.items():
            _within(value[key], limits, key)
        return kind(**{key: _number(value[key]) for key in names & given})

    return read


def _limits(value: Any) -> tuple[ResidualLimit, ...]:
    return tuple(_limit(entry) for entry in _list(value))


def _limit(value: Any) -> ResidualLimit:
    name = _text(value["name"])
    windows = tuple(_window_limit(window) for window in _list(value["windows"]))
    known = [limit.window for limit in windows if limit.window in WINDOWS]
    if not windows or len(known) != len(windows) or len(set(known)) != len(known):
        raise ValueError(f"{name}: windows {shown([w.window for w in windows])}, known {WINDOWS}")
    return ResidualLimit(
        name,
        windows,
        _regions(value["sigma"], _positive, name),
        _positive(value["correlation_samples"]),
        _spread(value.get("spread", []), name),
    )


def _spread(value: Any, name: str) -> tuple[float, ...]:
    numbers = tuple(map(_number, _list(value)))
    if len(numbers) not in (0, len(UNIT_PARAMETERS)):
        raise ValueError(f"{name}: spread has {len(numbers)} numbers, not {len(UNIT_PARAMETERS)}")
    return numbers


def _window_limit(value: Any) -> WindowLimit:
    window = _positive(value["window"])
    what = f"window {window:g}"
    return WindowLimit(
        int(window) if window == int(window) else 0,
        _regions(value["centre"], _number, what),
        _regions(value["sigma"], _positive, what),
        _positive(value["k"]),
    )


def _regions(value: Any, read: Callable[[Any], float], what: str) -> tuple[float, ...]:
    numbers = tuple(read(number) for number in _list(value))
    if len(numbers) != len(SPEED_REGIONS_M_S) + 1:
        raise ValueError(f"{what}: needs {len(SPEED_REGIONS_M_S) + 1} speed regions")
    return numbers


def _stretches(value: Any) -> tuple[BadStretch, ...]:
    return tuple(
        BadStretch(
            _text(entry["run"]),
            _text(entry["channel"]),
            _number(entry["start_s"]),
            _number(entry["end_s"]),
        )
        for entry in _list(value)
    )


def _covariance(value: Any) -> tuple[CovarianceBlock, ...]:
    known = {entry.name for entry in fields(ActuatorParameters)}
    blocks = []
    for entry in _list(value):
        names = _texts(entry["parameters"])
        odd = [name for name in names if name not in known]
        if odd:
            raise ValueError(f"{shown(odd[0])} is no parameter")
        matrix = tuple(tuple(map(_number, _list(row))) for row in _list(entry["matrix"]))
        if [len(row) for row in matrix] != [len(names)] * len(names):
            raise ValueError(f"{names[0] if names else 'a block'}: matrix is not square")
        for place, name in enumerate(names):
            if matrix[place][place] < 0.0:
                raise ValueError(f"{name}: variance {matrix[place][place]!r} is below 0")
        blocks.append(CovarianceBlock(names, matrix))
    return tuple(blocks)


def _envelope(value: Any) -> CalibrationEnvelope:
    rows = tuple(
        LeverageFit(
            _text(row["relation"]),
            tuple(tuple(map(_number, _list(line))) for line in _list(row["root"])),
            *(_positive(row[name]) for name in ("reach", "most")),
        )
        for row in _list(value["relations"])
    )
    ranges = {}
    for name, pair in value["ranges"].items():
        low, high = map(_number, _list(pair))
        ranges[_text(name)] = (low, high)
    return CalibrationEnvelope(_text(value["position"]), rows, ranges)


def _out_of_sample(value: Any) -> OutOfSample:
    recordings, alarms = (int(_not_negative(value[name])) for name in ("recordings", "alarms"))
    largest, widening = _not_negative(value["largest"]), _positive(value["widening"])
    return OutOfSample(recordings, alarms, largest, widening)


def _observer_noise(value: Any) -> ObserverNoise:
    levels = {_text(name): _within(level, LIKELY, name) for name, level in value.items()}
    if odd := [name for name in PROCESS if name not in levels]:
        raise ValueError(f"{odd[0]!r} is missing or unknown")
    return ObserverNoise.of(levels)


def _coverage(value: Any) -> GroupCoverage:
    nats = tuple(map(_positive, _list(value["nats"])))
    if list(nats) != sorted(nats):
        raise ValueError("nats must ascend")
    lost, missed = (int(_not_negative(value[name])) for name in ("lost", "missed"))
    return GroupCoverage(_text(value["campaign"]), nats, lost, missed)


PARAMETER_RANGES: Mapping[str, tuple[float, float]] = {
    "force_constant_n_per_a": (1e-3, 1e6),
    "back_emf_v_s_per_m": (1e-3, 1e6),
    "winding_resistance_ohm": (1e-6, 1e6),
    "stribeck_speed_m_s": (1e-6, 1e3),
    "reflected_mass_kg": (1e-3, 1e9),
    "motor_cooling_s": (1.0, 1e9),
    "nut_cooling_s": (1.0, 1e9),
}
"""Parameters that are positive on every actuator; the diagnosis divides by most of them. The
ranges are wide: a value outside is a typing error and would break the arithmetic."""

LARGEST = 1e15
"""Largest magnitude of a quantity in SI units."""
PERIOD_S = (1e-4, 1.0)
LIKELY = (1e-12, LARGEST)
"""Entries that must be above 0 and have no range of their own."""


_READERS: dict[str, Callable[[Any], Any]] = {
    "actuator": _text,
    "period_s": lambda value: _within(value, PERIOD_S),
    "channels": _texts,
    "voltage_sampling": _text,
    "parameters": _numbers_of(ActuatorParameters, PARAMETER_RANGES, later=LATER_PARAMETERS),
    "sigmas": lambda value: {_text(key): _not_negative(entry) for key, entry in value.items()},
    "not_identified": lambda value: {_text(key): _text(entry) for key, entry in value.items()},
    "tolerance": _numbers_of(
        UnitTolerance, {f.name: LIKELY for f in fields(UnitTolerance)}, retired=("noise_log",)
    ),
    "limits": _limits,
    "false_alarms_per_hour": _positive,
    "voltage_limit_v": _positive,
    "nominal_s": _positive,
    "sources": _texts,
    "bad_stretches": _stretches,
    "sensors": lambda value: tuple(SensorLimit.from_mapping(entry) for entry in _list(value)),
    "covariance": _covariance,
    "shifts": lambda value: tuple(MeanShiftLimit.from_mapping(entry) for entry in _list(value)),
    "observer_noise": _observer_noise,
    "actuator_sha256": _sha256,
    "out_of_sample": _out_of_sample,
    "envelope": _envelope,
    "coverage": _coverage,
    "left_out": lambda value: tuple(
        LeftOut(_text(entry["recording"]), _text(entry["reason"])) for entry in _list(value)
    ),
}
LATER = (
    "observer_noise", "sensors", "covariance", "shifts", "actuator_sha256", *SINCE_OUT_OF_SAMPLE,
)  # fmt: skip
"""Optional entries of this schema."""
