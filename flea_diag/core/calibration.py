"""What is learned from nominal recordings: parameters, uncertainties, limits. One frozen value.

``calibrate`` is the whole procedure: identify the parameters (``identification``), then run
the residuals of the same recordings through the limits (``thresholds``). The mapping form is
what a calibration file holds; it names the recordings that it came from.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.detection import SPEED_REGIONS_M_S, ResidualLimit, WindowLimit
from flea_diag.core.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residual import UNIT_PARAMETERS
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Run:
    """One nominal recording: rows of ``residual_bank.CHANNELS``, shape (scans, channels)."""

    name: str
    rows: Array


@dataclass(frozen=True, slots=True)
class BadStretch:
    """A piece of a recording in which a channel was not to be trusted (and was left out)."""

    run: str
    channel: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Calibration:
    """Everything the diagnoser knows of an actuator beyond its structure.

    ``sigmas`` holds the standard error of each identified parameter; a parameter that the
    recordings do not identify is in ``not_identified`` with the reason and keeps its default.
    """

    actuator: str
    period_s: float
    channels: tuple[str, ...]
    voltage_sampling: str
    parameters: ActuatorParameters
    sigmas: Mapping[str, float]
    not_identified: Mapping[str, str]
    tolerance: UnitTolerance
    limits: tuple[ResidualLimit, ...]
    false_alarms_per_hour: float
    voltage_limit_v: float
    nominal_s: float
    sources: tuple[str, ...]
    bad_stretches: tuple[BadStretch, ...] = ()

    def tolerances(self) -> tuple[float, ...]:
        """Spread of healthy units in the order of ``UNIT_PARAMETERS``."""
        return tuple(getattr(self.tolerance, name) for name in UNIT_PARAMETERS)

    def limit(self, residual: str) -> ResidualLimit | None:
        """Limits of one residual, None when this stand cannot form it."""
        return next((entry for entry in self.limits if entry.name == residual), None)

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping of numbers, strings and lists (what a YAML file holds)."""
        plain = {name: _plain(getattr(self, name)) for name in (f.name for f in fields(self))}
        return {
            "schema_version": SCHEMA_VERSION,
            **plain,
            "speed_regions_m_s": list(SPEED_REGIONS_M_S),
        }


def _plain(value: Any) -> Any:
    if hasattr(value, "__dataclass_fields__"):
        return {key: _plain(entry) for key, entry in asdict(value).items()}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return value.item()
    return value


def from_mapping(mapping: object, where: str) -> Calibration:
    """Calibration from its plain mapping.

    Raises
    ------
    CalibrationError
        Naming ``where`` and the entry that is missing, unknown, of the wrong kind or not finite.
    """
    if not isinstance(mapping, Mapping):
        raise CalibrationError(
            f"{where}: a calibration is a mapping, this is {type(mapping).__name__}"
        )
    if mapping.get("schema_version") != SCHEMA_VERSION:
        raise CalibrationError(
            f"{where}: schema_version = {mapping.get('schema_version')!r}, this version reads "
            f"{SCHEMA_VERSION}; make it anew with 'flea calibrate'"
        )
    if list(mapping.get("speed_regions_m_s", [])) != list(SPEED_REGIONS_M_S):
        raise CalibrationError(
            f"{where}: speed_regions_m_s = {mapping.get('speed_regions_m_s')!r}, this version "
            f"tests in {list(SPEED_REGIONS_M_S)!r}; make it anew with 'flea calibrate'"
        )
    known = {"schema_version", "speed_regions_m_s", *_READERS}
    for key in mapping:
        if key not in known:
            raise CalibrationError(f"{where}: unknown entry {key!r}, known are {sorted(known)}")
    values: dict[str, Any] = {}
    for key, reader in _READERS.items():
        if key not in mapping:
            raise CalibrationError(f"{where}: entry {key!r} is missing")
        try:
            values[key] = reader(mapping[key])
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            raise CalibrationError(f"{where}: {key}: {error}") from error
    return Calibration(**values)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a finite number")
    return float(value)


def _positive(value: Any) -> float:
    if not _number(value) > 0.0:
        raise ValueError(f"{value!r} must be above 0")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > 10_000:
        raise ValueError(f"{value!r} is not a text")
    return value


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(_text(entry) for entry in value)


def _numbers_of(kind: type) -> Callable[[Any], Any]:
    names = {entry.name for entry in fields(kind)}

    def read(value: Any) -> Any:
        if set(value) != names:
            odd = sorted(set(value) ^ names)
            raise ValueError(f"{odd[0]!r} is missing or unknown")
        return kind(**{key: _number(entry) for key, entry in value.items()})

    return read


def _limits(value: Any) -> tuple[ResidualLimit, ...]:
    return tuple(
        ResidualLimit(
            _text(entry["name"]),
            tuple(_window_limit(window) for window in entry["windows"]),
            tuple(_positive(number) for number in entry["sigma"]),
            _positive(entry["nominal"]),
            _positive(entry["correlation_samples"]),
        )
        for entry in value
    )


def _window_limit(value: Any) -> WindowLimit:
    window = int(_positive(value["window"]))
    centre = tuple(_number(number) for number in value["centre"])
    sigma = tuple(_positive(number) for number in value["sigma"])
    if not len(centre) == len(sigma) == len(SPEED_REGIONS_M_S) + 1:
        raise ValueError(f"window {window}: needs {len(SPEED_REGIONS_M_S) + 1} speed regions")
    return WindowLimit(window, centre, sigma, _positive(value["k"]))


def _stretches(value: Any) -> tuple[BadStretch, ...]:
    return tuple(
        BadStretch(
            _text(entry["run"]),
            _text(entry["channel"]),
            _number(entry["start_s"]),
            _number(entry["end_s"]),
        )
        for entry in value
    )


_READERS: dict[str, Callable[[Any], Any]] = {
    "actuator": _text,
    "period_s": _positive,
    "channels": _texts,
    "voltage_sampling": _text,
    "parameters": _numbers_of(ActuatorParameters),
    "sigmas": lambda value: {_text(key): _number(entry) for key, entry in value.items()},
    "not_identified": lambda value: {_text(key): _text(entry) for key, entry in value.items()},
    "tolerance": _numbers_of(UnitTolerance),
    "limits": _limits,
    "false_alarms_per_hour": _positive,
    "voltage_limit_v": _positive,
    "nominal_s": _positive,
    "sources": _texts,
    "bad_stretches": _stretches,
}
