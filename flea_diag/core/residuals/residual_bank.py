"""Residual bank: parity relations and thermal models evaluated on a stream of scans.

``residual_rows.RESIDUALS`` is the whole set. The bank keeps the state that streaming needs (last
rows, thermal states), none of detection. One row or many, in Python or compiled, give the same
bits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.residuals.bank_loops import BANK
from flea_diag.core.residuals.parameters import ActuatorParameters, as_record
from flea_diag.core.residuals.residual import (
    PARITIES,
    STALL,
    UNIT_PARAMETERS,
    Signals,
    Value,
    direction,
    dry_friction_n,
    push_n,
)
from flea_diag.core.residuals.residual_rows import (
    CHANNELS,
    INDEX,
    RESIDUAL_INDEX,
    RESIDUALS,
    SPREAD_ROWS,
    ResidualRows,
)
from flea_diag.core.residuals.thermal import ThermalNode
from flea_diag.core.smoothing import Smoother

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class ResidualBank:
    """Computes residuals from a stream of scans, constant memory."""

    def __init__(
        self,
        parameters: ActuatorParameters,
        *,
        period_s: float = 0.01,
        kernel_length: int = 31,
        moving_m_s: float = 0.010,
        start_samples: int = 100,
        backend: str = "auto",
    ) -> None:
        self._compiled = backends.chosen(backend) == "numba"
        self.adopt(parameters)
        self._period_s = period_s
        self._moving_m_s = moving_m_s
        self._kernel_length = kernel_length
        self._still = 0
        self._smoother = Smoother(len(CHANNELS), kernel_length, period_s)
        self._motor = ThermalNode(parameters.motor_cooling_s, start_samples)
        self._nut = ThermalNode(parameters.nut_cooling_s, start_samples)
        self._ambient = ThermalNode(math.inf, start_samples)
        self.has_encoder = parameters.encoder_m_per_rad != 0.0

    def step(self, rows: Array, frozen: bool) -> ResidualRows:
        """Residuals of n >= 1 rows of ``CHANNELS``, one after the other; shape (n, channels).

        ``frozen`` stops every correction.
        """
        _, smooth = self._smoother.push(rows)
        values = np.full((len(rows), len(RESIDUALS)), np.nan)
        spread = np.zeros((len(rows), len(SPREAD_ROWS), len(UNIT_PARAMETERS)))
        if self._compiled:
            return self._follow(rows, smooth, frozen, values, spread)
        signals, moving = self._signals(rows, smooth, frozen, values)
        self._parities(signals, values, spread)
        return ResidualRows(values, spread, signals, moving)

    def _follow(
        self, rows: Array, smooth: Array, frozen: bool, values: Array, spread: Array
    ) -> ResidualRows:
        """``_signals`` and ``_parities`` in one compiled loop."""
        speeds = smooth[:, 1, INDEX["actuator_position"]]
        if self.has_encoder:
            speeds = smooth[:, 0, INDEX["motor_speed"]] * self._p.encoder_m_per_rad
        table = np.empty((len(rows), len(Signals._fields)))
        moving = np.empty(len(rows), dtype=bool)
        self._still = backends.exact(*BANK)(
            rows,
            smooth,
            direction(self._p, speeds),
            self._record,
            (self._ambient.state, self._nut.state, self._motor.state),
            (self._moving_m_s, self._kernel_length, self._period_s),
            self._still,
            frozen,
            (values, spread, table, moving),
        )
        columns = table[0].tolist() if len(table) == 1 else np.ascontiguousarray(table.T)
        return ResidualRows(values, spread, Signals(*columns), moving)

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters (the learned offsets of this unit)."""
        self._p, self._record = parameters, as_record(parameters)

    def interrupt(self) -> None:
        """A gap in the stream: restart smoothing, keep the temperatures."""
        self._smoother.clear()
        self._still = 0

    def _signals(
        self, rows: Array, smooth: Array, frozen: bool, values: Array
    ) -> tuple[Signals, Flags]:
        """Smoothed signals, and whether it moves or is stalled.

        Fills in the thermal residuals, whose estimates are among the signals.
        """
        value, first, second = _columns(smooth)
        position, encoder = INDEX["actuator_position"], INDEX["motor_speed"]
        # The encoder where there is one: then a position fault does not touch the speed.
        lead = self._p.encoder_m_per_rad
        speed = value[encoder] * lead if self.has_encoder else first[position]
        acceleration = first[encoder] * lead if self.has_encoder else second[position]
        current, load = value[INDEX["motor_current"]], value[INDEX["load_force"]]
        way, moving = self._way(len(rows), current, load, (speed, first[position]), acceleration)
        signals = Signals(
            current_a=current,
            voltage_v=value[INDEX["motor_voltage"]],
            commanded_voltage_v=value[INDEX["commanded_voltage"]],
            speed_m_s=speed,
            acceleration_m_s2=acceleration,
            load_n=load,
            position_m=value[position],
            load_position_m=value[INDEX["load_position"]],
            encoder_speed_rad_s=value[encoder],
            position_rate_m_s=first[position],
            motor_temperature_degc=value[INDEX["motor_temperature"]],
            nut_temperature_degc=value[INDEX["nut_temperature"]],
            winding_rise_k=self._thermal(rows, current, speed, frozen, values),
            direction=way,
        )
        return signals, moving

    def _way(
        self,
        count: int,
        current_a: Value,
        load_n: Value,
        speeds_m_s: tuple[Value, Value],
        acceleration_m_s2: Value,
    ) -> tuple[Value, Flags]:
        """Smooth sign of the motion, or of the push where it is stalled; whether it is either."""
        p, (speed, rate) = self._p, speeds_m_s
        moving = np.empty(count, dtype=bool)
        moving[:] = (abs(speed) > self._moving_m_s) | (abs(rate) > self._moving_m_s)
        push = push_n(p, current_a, load_n, acceleration_m_s2)
        stands = ~moving & (abs(speed) <= self._moving_m_s)  # and not: no speed is known
        stalled = self._rests(stands) & (abs(push) > STALL * dry_friction_n(p, load_n))
        way = np.where(stalled, np.copysign(1.0, push), direction(p, speed))
        return float(way[0]) if count == 1 else way, moving | stalled

    def _rests(self, stands: Flags) -> Flags:
        """Whether it has stood for longer than the kernel is: a reversal is no standstill."""
        scans = np.arange(len(stands))
        still = scans - np.maximum.accumulate(np.where(stands, -1 - self._still, scans))
        self._still = int(still[-1])
        rests: Flags = still > self._kernel_length
        return rests

    def _thermal(
        self, rows: Array, current_a: Value, speed_m_s: Value, frozen: bool, values: Array
    ) -> Value:
        """Fill in the thermal residuals; returns the rise of the winding before each scan."""
        p, ambient = self._p, rows[:, INDEX["ambient_temperature"]].tolist()
        excess = current_a - p.current_offset_a
        copper = p.motor_heating_k_per_a2s * (excess * excess)
        rubbing = p.nut_heating_k_per_j * p.coulomb_friction_n * abs(speed_m_s)
        motor_degc: list[float] = []
        for name, node, heat in (
            ("ambient_temperature", self._ambient, np.zeros(len(rows))),
            ("nut_temperature", self._nut, rubbing),
            ("motor_temperature", self._motor, copper),
        ):
            measured = rows[:, INDEX[name]].tolist()
            values[:, RESIDUAL_INDEX[name]], motor_degc = node.follow(
                measured, np.atleast_1d(heat).tolist(), ambient, self._period_s, frozen
            )
        rise = [0.0 if t != t else t - p.reference_temperature_degc for t in motor_degc]
        return rise[0] if len(rise) == 1 else np.array(rise)

    def _parities(self, signals: Signals, values: Array, spread: Array) -> None:
        """Fill in every parity relation and what healthy units differ by in it."""
        single = len(values) == 1
        sign = (math if single else np).copysign(1.0, signals.direction)
        formed = {relation: relation(self._p, signals) for relation in _RELATIONS}
        spreads = {sensitivity: sensitivity(self._p, signals) for sensitivity in _SENSITIVITIES}
        found, apart = [], []
        for parity in PARITIES:
            factor = sign if parity.normalised else 1.0
            found.append(factor * formed[parity.relation])
            if parity.sensitivity is not None:
                apart.append([factor * value for value in spreads[parity.sensitivity]])
        if single:
            values[0, : len(found)], spread[0] = found, apart
            return
        for index, column in enumerate(found):
            values[:, index] = column
        for place, columns in enumerate(apart):
            for k, column in enumerate(columns):
                spread[:, place, k] = column


_RELATIONS = tuple(dict.fromkeys(row.relation for row in PARITIES))
_SENSITIVITIES = tuple(dict.fromkeys(r.sensitivity for r in PARITIES if r.sensitivity is not None))


def _columns(smooth: Array) -> Any:
    """Value, first and second derivative of each channel: numbers of one scan, else columns."""
    if len(smooth) == 1:
        return smooth[0].tolist()
    return np.ascontiguousarray(smooth.transpose(1, 2, 0))
