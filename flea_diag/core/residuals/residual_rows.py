"""All residuals, one row each, and the table of their values.

A new residual is a row of ``RESIDUALS`` here and, for a parity relation, a row in
``residual.PARITIES`` and in the description. ``residual_bank`` computes them; rows of single
sensors are filled by ``sensor_tests``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual import PARITIES, SPEED, Parity
from flea_diag.core.sensors.sensor_tests import NAMES as SENSOR_TESTS
from flea_diag.core.sensors.sensor_tests import channel_of
from flea_diag.errors import shown

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

CHANNELS = (
    "motor_current",
    "motor_voltage",
    "commanded_voltage",
    "motor_speed",
    "actuator_position",
    "load_position",
    "load_force",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
)
"""Channels that the diagnosis reads, in the order of every row in this module."""
UNITS = {
    "motor_current": "A",
    "motor_voltage": "V",
    "commanded_voltage": "V",
    "motor_speed": "rad/s",
    "actuator_position": "m",
    "load_position": "m",
    "load_force": "N",
    "motor_temperature": "degC",
    "nut_temperature": "degC",
    "ambient_temperature": "degC",
}
"""Unit that the diagnosis takes each of these channels to be in."""
ACCELEROMETER, ACCELERATION = "accelerometer_", "m/s^2"
"""First part of the name of each axis of vibration, and its unit."""
SPELLINGS = {
    "A": ("ampere", "amperes"),
    "V": ("volt", "volts"),
    "rad/s": ("rad*s^-1", "rad s^-1"),
    "m": ("meter", "meters", "metre", "metres"),
    "N": ("newton", "newtons"),
    "degC": ("C", "°C", "℃", "celsius", "Celsius"),
    "m/s^2": ("m/s²", "m/s2", "m/s**2", "m*s^-2"),
}
"""Other spellings of the same unit."""
INDEX = {name: index for index, name in enumerate(CHANNELS)}
TEMPERATURES = ("motor_temperature", "nut_temperature", "ambient_temperature")

INNOVATION_CHANNELS = ("motor_current", "motor_speed", "actuator_position")
"""Channels whose prediction by the state observer is tested."""


@dataclass(frozen=True, slots=True)
class ResidualRow:
    """One residual: its unit, the channels it needs, and when it may be tested.

    ``gate`` is "moving" where the excitation of motion is needed, "always" where not, and
    "sensor" where ``sensor_tests`` judge it. ``windows`` are the numbers of samples over which
    it is averaged before a test. A row with ``isolates`` False detects, but makes no symbol.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gate: str
    windows: tuple[int, ...]
    isolates: bool = True


def unit_refusal(channel: str, unit: str) -> str:
    """Why a channel in this unit cannot be used; empty where it can, or its unit is unknown.

    Values are not converted: a factor that is right for one channel hides a wrong one of another.
    """
    needed = ACCELERATION if channel.startswith(ACCELEROMETER) else UNITS.get(channel, "")
    if not needed or unit in ("", needed, *SPELLINGS[needed]):
        return ""
    return f"{channel} is in {shown(unit)}, must be in {needed!r}: convert it at the source"


PARITY_WINDOWS = (50, 100, 400)
THERMAL_WINDOWS = (50, 100, 400)


def _parity_row(row: Parity) -> ResidualRow:
    gate = "moving" if row.gated else "always"
    return ResidualRow(row.name, row.unit, row.needs, gate, PARITY_WINDOWS)


def _innovation_rows(channel: str) -> tuple[ResidualRow, ResidualRow]:
    needs = (channel, "motor_voltage", SPEED)
    raw = ResidualRow(f"innovation_{channel}", "1", needs, "moving", PARITY_WINDOWS, False)
    return raw, ResidualRow(f"{raw.name}_dn", "1", needs, "moving", PARITY_WINDOWS, False)


def together(columns: list[int]) -> slice:
    """Columns that lie side by side, as those of one kind do, as a slice."""
    start = columns[0] if columns else 0
    assert columns == list(range(start, start + len(columns)))
    return slice(start, start + len(columns))


RESIDUALS: tuple[ResidualRow, ...] = (
    *(_parity_row(row) for row in PARITIES),
    ResidualRow("motor_temperature", "K", ("motor_temperature",), "always", THERMAL_WINDOWS),
    ResidualRow("nut_temperature", "K", ("nut_temperature",), "always", THERMAL_WINDOWS),
    ResidualRow("ambient_temperature", "K", ("ambient_temperature",), "always", THERMAL_WINDOWS),
    *(ResidualRow(name, "1", (channel_of(name),), "sensor", (1,)) for name in SENSOR_TESTS),
    *(row for channel in INNOVATION_CHANNELS for row in _innovation_rows(channel)),
)
RESIDUAL_INDEX = {row.name: index for index, row in enumerate(RESIDUALS)}
SENSOR_COLUMNS = together([j for j, row in enumerate(RESIDUALS) if row.gate == "sensor"])
"""Filled by ``sensor_tests``, in its own order."""
INNOVATION_INDEX = {name: at for name, at in RESIDUAL_INDEX.items() if name.startswith("innov")}
"""Filled by the state observer, not by the bank."""
INNOVATION_COLUMNS = together(list(INNOVATION_INDEX.values()))
SPREAD_ROWS = tuple(RESIDUAL_INDEX[row.name] for row in PARITIES if row.differs)
"""Residuals in which healthy units differ, in the order of ``ResidualRows.spread``."""


@dataclass(slots=True)
class ResidualRows:
    """All residuals of n scans; NaN where one cannot be computed.

    Not frozen: cross-checks of channels drop unusable values.

    ``values`` has shape (n, residuals), order of ``RESIDUALS``, and ``spread`` (n, ``SPREAD_ROWS``,
    unit parameters): d r / d theta of healthy units. ``signals``, shape (n, signals), are those of
    the relations, in their order, smoothed, NaN where a channel is absent or bad. ``motion``, shape
    (n, 2), is the speed at the nut, m/s, and the smooth sign of the motion, or of the push where
    the actuator is stalled. ``moving``, (n,), includes a standstill under a force that moves any
    healthy unit.
    """

    values: Array
    spread: Array
    signals: Array
    motion: Array
    moving: Flags

    def __len__(self) -> int:
        return len(self.values)

    @property
    def speed_m_s(self) -> Array:
        """Speed at the nut, shape (n,)."""
        return self.motion[:, 0]

    def leave_out(self, scans: Flags, columns: list[int]) -> None:
        """Drop these residuals in these scans."""
        for column in columns:
            self.values[scans, column] = np.nan
