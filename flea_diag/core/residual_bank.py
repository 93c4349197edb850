"""From a scan to every residual: parity relations, thermal models, innovations, noise levels.

``RESIDUALS`` is the whole set, one row each; a new residual is a row here and, for a parity
relation, a row in ``residual.PARITIES``. The bank keeps what streaming needs (the smoothing
window, thermal states, last samples) and nothing of detection.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.parameters import ActuatorParameters
from flea_diag.core.residual import PARITIES, SPEED, UNIT_PARAMETERS, Parity, Signals
from flea_diag.core.smoothing import Smoother
from flea_diag.core.thermal import ThermalNode

Array = npt.NDArray[np.float64]

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
INDEX = {name: index for index, name in enumerate(CHANNELS)}

NOISE_CHANNELS = {
    "motor_current": "moving",
    "motor_speed": "moving",
    "actuator_position": "moving",
    "load_position": "moving",
    "load_force": "moving",
    "motor_temperature": "always",
    "nut_temperature": "always",
}
"""Channels whose noise is watched, and when: that of current and load comes with motion."""
JUMP_CHANNELS = ("actuator_position", "load_position")
INNOVATION_CHANNELS = ("motor_current", "motor_speed", "actuator_position")
"""Channels whose prediction by the state observer is tested."""


JUMP_TRACE = 6
"""Scans from the one that shows a jump to the last whose noise it spoils."""


@dataclass(frozen=True, slots=True)
class ResidualRow:
    """One residual: its unit, the channels it needs, and when it may be tested.

    ``gate`` is "moving" where the excitation of motion is needed, else "always". ``windows``
    are the numbers of samples over which it is averaged before a test. What does not isolate
    detects, but makes no symbol.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gate: str
    windows: tuple[int, ...]
    isolates: bool = True


PARITY_WINDOWS = (50, 100, 400)
THERMAL_WINDOWS = (50, 100, 400)
NOISE_WINDOWS = (50, 100, 400)


def _parity_row(row: Parity) -> ResidualRow:
    gate = "moving" if row.gated else "always"
    return ResidualRow(row.name, row.unit, row.needs, gate, PARITY_WINDOWS)


def _innovation_rows(channel: str) -> tuple[ResidualRow, ResidualRow]:
    needs = (channel, "motor_voltage", SPEED)
    raw = ResidualRow(f"innovation_{channel}", "1", needs, "moving", PARITY_WINDOWS, False)
    return raw, ResidualRow(f"{raw.name}_dn", "1", needs, "moving", PARITY_WINDOWS, False)


RESIDUALS: tuple[ResidualRow, ...] = (
    *(_parity_row(row) for row in PARITIES),
    ResidualRow("motor_temperature", "K", ("motor_temperature",), "always", THERMAL_WINDOWS),
    ResidualRow("nut_temperature", "K", ("nut_temperature",), "always", THERMAL_WINDOWS),
    ResidualRow("ambient_temperature", "K", ("ambient_temperature",), "always", THERMAL_WINDOWS),
    *(ResidualRow(name, "m", (name,), "jump", (1,)) for name in JUMP_CHANNELS),
    *(
        ResidualRow(f"{name}_noise", "1", (name,), gate, NOISE_WINDOWS)
        for name, gate in NOISE_CHANNELS.items()
    ),
    *(row for channel in INNOVATION_CHANNELS for row in _innovation_rows(channel)),
)
RESIDUAL_INDEX = {row.name: index for index, row in enumerate(RESIDUALS)}
INNOVATION_INDEX = {name: at for name, at in RESIDUAL_INDEX.items() if name.startswith("innov")}
"""Filled by the state observer, not by the bank."""


@dataclass(slots=True)
class ResidualSample:
    """All residuals of one scan, order of ``RESIDUALS``; NaN where one cannot be formed.

    Not frozen: cross-checks of channels take out what is not to be used.

    ``spread`` has shape (residuals, unit parameters): d r / d theta of healthy units.
    """

    values: Array
    spread: Array
    signals: Signals
    moving: bool


class ResidualBank:
    """Streams scans into residuals, constant memory."""

    def __init__(
        self,
        parameters: ActuatorParameters,
        *,
        period_s: float = 0.01,
        kernel_length: int = 31,
        moving_m_s: float = 0.010,
        start_samples: int = 100,
    ) -> None:
        self._p = parameters
        self._period_s = period_s
        self._moving_m_s = moving_m_s
        self._smoother = Smoother(len(CHANNELS), kernel_length, period_s)
        self._last = np.full((4, len(CHANNELS)), np.nan)
        self._jumps = {name: _JumpPredictor() for name in JUMP_CHANNELS}
        self._traces = dict.fromkeys(JUMP_CHANNELS, 0)
        self._held = {name: deque([math.nan] * 4, maxlen=4) for name in JUMP_CHANNELS}
        self._motor = ThermalNode(parameters.motor_cooling_s, start_samples)
        self._nut = ThermalNode(parameters.nut_cooling_s, start_samples)
        self._ambient = ThermalNode(math.inf, start_samples)
        self.has_encoder = parameters.encoder_m_per_rad != 0.0

    def step(self, row: Array, frozen: bool) -> ResidualSample:
        """Residuals after one row of ``CHANNELS``; ``frozen`` stops every correction."""
        smooth = self._smoother.push(row)
        signals = self._signals(smooth)
        speeds = abs(signals.speed_m_s), abs(signals.position_rate_m_s)
        moving = any(speed > self._moving_m_s for speed in speeds)
        values = np.full(len(RESIDUALS), np.nan)
        spread = np.zeros((len(RESIDUALS), len(UNIT_PARAMETERS)))
        sign = math.copysign(1.0, signals.speed_m_s)
        for parity in PARITIES:
            index = RESIDUAL_INDEX[parity.name]
            factor = sign if parity.normalised else 1.0
            values[index] = factor * parity.relation(self._p, signals)
            spread[index] = parity.sensitivity(self._p, signals)
            spread[index] *= factor
        self._thermal(row, signals, frozen, values)
        self._noise(row, values)
        for name, predictor in self._jumps.items():
            self._jump(name, predictor.step(float(row[INDEX[name]])), values)
        return ResidualSample(values, spread, signals, moving)

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Go on with other parameters (the offsets of this unit, once they are learned)."""
        self._p = parameters

    def interrupt(self) -> None:
        """A gap in the stream: smooth and predict anew, keep the temperatures."""
        self._smoother.clear()
        self._last[:] = np.nan
        self._jumps = {name: _JumpPredictor() for name in JUMP_CHANNELS}

    def _signals(self, smooth: Array) -> Signals:
        value, first, second = smooth
        position, encoder = INDEX["actuator_position"], INDEX["motor_speed"]
        # The encoder where there is one: then a position fault does not touch the speed.
        source, lead = (encoder, self._p.encoder_m_per_rad) if self.has_encoder else (position, 1.0)
        speed = value[source] * lead if self.has_encoder else first[source]
        acceleration = first[source] * lead if self.has_encoder else second[source]
        return Signals(
            current_a=float(value[INDEX["motor_current"]]),
            voltage_v=float(value[INDEX["motor_voltage"]]),
            commanded_voltage_v=float(value[INDEX["commanded_voltage"]]),
            speed_m_s=float(speed),
            acceleration_m_s2=float(acceleration),
            load_n=float(value[INDEX["load_force"]]),
            position_m=float(value[position]),
            load_position_m=float(value[INDEX["load_position"]]),
            encoder_speed_rad_s=float(value[encoder]),
            position_rate_m_s=float(first[position]),
            motor_temperature_degc=float(value[INDEX["motor_temperature"]]),
            nut_temperature_degc=float(value[INDEX["nut_temperature"]]),
            winding_rise_k=self._winding_rise(),
        )

    def _winding_rise(self) -> float:
        estimate = self._motor.estimate_degc
        return 0.0 if math.isnan(estimate) else estimate - self._p.reference_temperature_degc

    def _thermal(self, row: Array, signals: Signals, frozen: bool, values: Array) -> None:
        p, ambient = self._p, float(row[INDEX["ambient_temperature"]])
        copper = p.motor_heating_k_per_a2s * (signals.current_a - p.current_offset_a) ** 2
        rubbing = p.nut_heating_k_per_j * p.coulomb_friction_n * abs(signals.speed_m_s)
        for name, node, heat in (
            ("motor_temperature", self._motor, copper),
            ("nut_temperature", self._nut, rubbing),
            ("ambient_temperature", self._ambient, 0.0),
        ):
            measured = float(row[INDEX[name]])
            values[RESIDUAL_INDEX[name]] = node.step(
                measured, heat, ambient, self._period_s, frozen
            )

    def _noise(self, row: Array, values: Array) -> None:
        # Third difference over sqrt(20): blind to motion, unit gain for white noise.
        third = row - 3.0 * self._last[2] + 3.0 * self._last[1] - self._last[0]
        self._last[:3] = self._last[1:]
        self._last[2] = row
        for name in NOISE_CHANNELS:
            values[RESIDUAL_INDEX[f"{name}_noise"]] = abs(third[INDEX[name]]) / math.sqrt(20.0)

    def _jump(self, name: str, jump: float, values: Array) -> None:
        """A jump of a position, and its noise as far as that is not the jump's own trace.

        The noise of these channels is held back by as many samples as a jump takes to show.
        """
        values[RESIDUAL_INDEX[name]] = jump
        noise = RESIDUAL_INDEX[f"{name}_noise"]
        held = self._held[name]
        held.append(float(values[noise]))
        if jump != 0.0:
            self._traces[name] = JUMP_TRACE
        values[noise] = held[0] if self._traces[name] == 0 else math.nan
        self._traces[name] = max(self._traces[name] - 1, 0)


class _JumpPredictor:
    """How far a position has jumped from the parabola through the samples before.

    Three successive samples are held against the parabola through the six before them; the
    smallest of the three counts, and only if all agree in sign. A single outlier is no jump,
    nor is a mass that stops dead at an end stop: what it can fall short by is taken off.
    """

    _HISTORY = 6
    _AHEAD = 3

    def __init__(self) -> None:
        steps = np.arange(self._HISTORY + self._AHEAD, dtype=float)
        powers = np.stack((np.ones_like(steps), steps, steps**2), axis=1)
        # Rows: weights of the history in the prediction of each of the three samples ahead.
        self._weights = powers[self._HISTORY :] @ np.linalg.pinv(powers[: self._HISTORY])
        self._samples = np.full(self._HISTORY + self._AHEAD, np.nan)

    def step(self, value: float) -> float:
        self._samples[:-1] = self._samples[1:]
        self._samples[-1] = value
        apart = self._samples[self._HISTORY :] - self._weights @ self._samples[: self._HISTORY]
        low, high = float(apart.min()), float(apart.max())
        if math.isnan(low):
            return math.nan
        stop = self._AHEAD * float(np.abs(np.diff(self._samples[: self._HISTORY])).max())
        return max(low - stop, 0.0) + min(high + stop, 0.0)
