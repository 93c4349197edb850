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

"""Residual bank: parity relations and thermal models evaluated on a stream of scans.

``ResidualSet.rows`` is the whole set. The bank keeps the state that streaming needs (last
rows, thermal states), none of detection. One row or many, in Python or compiled, give the same
bits.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.machine_modes import HELD, OUT, MachineModes
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.bank_loops import bank_of, layout, winding_of
from flea_diag.core.residuals.parameters import (
    UNIT_PARAMETERS,
    ActuatorParameters,
    as_record,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual import STALL, Value, direction
from flea_diag.core.residuals.residual_rows import SPEED
from flea_diag.core.residuals.settling import Settling
from flea_diag.core.residuals.thermal import PredictedStores
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.smoothing import Smoother
from flea_diag.core.symbolic.expression import FUNCTIONS, symbols

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

START_S = 1.0
"""Readings at the start whose mean a predicted store starts from."""


class ResidualBank:
    """Computes residuals from a stream of scans, constant memory.

    ``relations`` are those of the actuator whose ``parameters`` these are; ``most_supplied`` is
    what its recordings supplied each predicted store with (``PredictedStores.of``).
    """

    def __init__(
        self,
        parameters: ActuatorParameters,
        relations: RelationSet,
        *,
        period_s: float,
        counts: ScanCounts,
        backend: str = "auto",
        most_supplied: Mapping[str, float] | None = None,
    ) -> None:
        self._relations, self._layout = relations, layout(relations)
        self._winding = winding_of(relations)
        self._places = self._layout.places
        self._functions = [FUNCTIONS[shape.name] for shape in relations.shapes.values()]
        within = {name for shape in relations.shapes.values() for name in symbols(shape)}
        self._inside = [
            place if name in within else (-1, 0)
            for name, place in zip(relations.signals, self._places, strict=True)
        ]
        # numba knows no empty tuple of results.
        self._compiled = backends.chosen(backend) == "numba" and bool(relations.differing)
        rows = relations.residuals
        start = counts.of(START_S)
        self._stores = PredictedStores.of(relations, rows.index, rows.place, start, most_supplied)
        self._width, self._spreading = len(rows.rows), len(rows.spreading)
        self.adopt(parameters)
        self._period_s = period_s
        self._moving_m_s = parameters.moving_m_s
        self._kernel_length = counts.kernel
        self._still = 0
        self._smoother = Smoother(len(rows.channels), counts.kernel, period_s)
        self._fine = rows.columns(rows.of_one_speed)
        self._settling = Settling(rows, period_s, counts.kernel)
        self._modes = MachineModes(rows.modes, period_s, counts.kernel) if rows.modes else None
        self._held = [k for k, row in enumerate(rows.modes) if row.stands]
        current = rows.current
        self._current = relations.signals.index(current) if current in relations.signals else -1
        self._untold = self._current >= 0 and any(row.name == HELD for row in rows.modes)
        self.has_encoder = self._layout.encoder >= 0 and parameters.encoder_m_per_rad != 0.0
        self._reads = [self._read_by(row.needs) for row in rows.parities]

    def step(
        self, rows: Array, frozen: bool, held: Array | None = None, refused: Flags | None = None
    ) -> ResidualRows:
        """Residuals of n >= 1 rows of readings, one after the other; shape (n, channels).

        ``frozen`` stops every correction. ``held`` are the same rows with the last reading in
        place of those that are missing for a moment, ``refused``, of the same shape, what is
        missing since it is not to be used; None: none is.
        """
        smooth, noise = self._smoother.push(rows, refused)
        values = np.empty((len(rows), self._width))
        values.fill(math.nan)
        spread = np.zeros((len(rows), self._spreading, len(UNIT_PARAMETERS)))
        if self._compiled:
            formed = self._follow(rows, smooth, frozen, values, spread)
        else:
            x, way, moving = self._signals(rows, smooth, frozen, values)
            self._parities(way[1], x, values, spread)
            signals, motion = _table(x, len(rows)), _table(way, len(rows))
            formed = ResidualRows(values, spread, signals, motion, moving)
        self._settling.leave_out(formed)
        if self._modes is not None:
            self._leave_out(self._modes, rows if held is None else held, formed)
        if noise is not None:
            formed.noise = self._noise(noise)
            # Sensors of one speed agree better than any curve through a gap.
            for column in self._fine:
                formed.leave_out(formed.noise[:, column] > 1.0, [column])
        return formed

    def thaw(self, columns: Collection[int]) -> None:
        """Let what these residuals predict follow its sensor, whatever is frozen."""
        self._stores.thaw(columns)

    def _read_by(self, needs: Sequence[str]) -> tuple[list[int], list[int]]:
        """Orders of derivative and channels that a residual with these needs reads."""
        rows = self._relations.residuals
        speed = rows.encoder if self.has_encoder else rows.position
        channels = {rows.channel(speed if name == SPEED else name) for name in needs}
        ways = [(0, self._layout.encoder), (1, self._layout.position)]
        read = {place for place in (*self._places, *ways) if place[1] in channels - {-1}}
        return [order for order, _ in read], [channel for _, channel in read]

    def _noise(self, noise: Array) -> Array:
        """Noise of each residual, that of the worst signal in it; shape (n, residuals)."""
        found = np.ones((len(noise), self._width))
        for place, (orders, channels) in enumerate(self._reads):
            found[:, place] = noise[:, orders, channels].max(axis=1, initial=1.0)
        return found

    def _leave_out(self, modes: MachineModes, rows: Array, formed: ResidualRows) -> None:
        """Drop what has no value in a mode; what a brake holds does not stand against a drag."""
        held = self._without_current(formed) if self._untold else None
        formed.modes, voids = modes.step(rows, held)
        for columns, scans in voids:
            formed.leave_out(scans, list(columns))
        formed.moving[(formed.modes[:, self._held] != OUT).any(axis=1)] = False

    def _without_current(self, formed: ResidualRows) -> Flags:
        """Where it stands under a push of which the motor's part is no more than dry friction.

        A stalled machine alone has a direction of exactly 1 or -1 below the speed of motion.
        """
        speed, way = formed.motion.T
        stalled: Flags = formed.moving & (abs(speed) <= self._moving_m_s) & (abs(way) == 1.0)
        if not stalled.any():
            return stalled
        signals = list(formed.signals.T)
        push, dry = self._relations.functions["drag"](self._p, signals)
        signals[self._current] = np.full(len(formed), self._p.current_offset_a)
        rest, _ = self._relations.functions["drag"](self._p, signals)
        held: Flags = stalled & (abs(push - rest) <= dry)
        return held

    def _follow(
        self, rows: Array, smooth: Array, frozen: bool, values: Array, spread: Array
    ) -> ResidualRows:
        """``_signals`` and ``_parities`` in one compiled loop."""
        signals, motion = np.empty((len(rows), len(self._places))), np.empty((len(rows), 2))
        moving = np.empty(len(rows), dtype=bool)
        # Numbers of one scan: it costs less than columns.
        columns = smooth[0].tolist() if len(rows) == 1 else smooth.transpose(1, 2, 0)
        x = [columns[order][k] if order >= 0 else 0.0 for order, k in self._inside]
        shapes = np.array(self._shapes(x)).reshape(len(self._relations.shapes), len(rows))
        self._still = bank_of(self._relations)(
            rows,
            smooth,
            self._directions(smooth, shapes),
            shapes,
            self._record,
            tuple(self._stores),  # numba takes a plain one in a third of the time
            self._winding,
            (self._moving_m_s, self._kernel_length, self._period_s),
            self._still,
            frozen,
            (values, spread, signals, motion, moving),
        )
        return ResidualRows(values, spread, signals, motion, moving)

    def _directions(self, smooth: Array, shapes: Array) -> Array:
        """Smooth sign of the speed: a shape where a relation holds it."""
        if self._layout.direction >= 0:
            row: Array = shapes[self._layout.direction - len(self._places)]
            return row
        position, encoder = self._layout.position, self._layout.encoder
        speeds = smooth[:, 1, position] if position >= 0 else np.full(len(smooth), math.nan)
        if self.has_encoder:
            speeds = smooth[:, 0, encoder] * self._p.encoder_m_per_rad
        return np.asarray(direction(self._p, speeds))

    def _measured(self, columns: Any) -> list[Value]:
        """Signals of the relations that are smoothed channels; 0 in place of the others."""
        return [columns[order][k] if order >= 0 else 0.0 for order, k in self._places]

    def _shapes(self, x: list[Value]) -> list[Value]:
        """Values of the shapes, by numpy for one number, too: libraries differ in the last bit."""
        arguments = self._relations.functions["shapes"](self._p, x)
        return [
            float(function(argument)) if isinstance(argument, float) else function(argument)
            for function, argument in zip(self._functions, arguments, strict=True)
        ]

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters (the learned offsets of this unit)."""
        self._p, self._record = parameters, as_record(parameters)
        self._stores.adopt(self._relations, parameters)

    def interrupt(self) -> None:
        """A gap in the stream: restart smoothing, keep the temperatures."""
        self._smoother.clear()
        self._still = 0
        if self._modes is not None:
            self._modes.interrupt()

    def _signals(
        self, rows: Array, smooth: Array, frozen: bool, values: Array
    ) -> tuple[list[Value], tuple[Value, Value], Flags]:
        """Signals of the relations, speed and direction, and whether it moves or is stalled.

        Fills in the thermal residuals, whose estimates are among the signals.
        """
        columns = value, first, _ = _columns(smooth)
        x = self._measured(columns)
        x[len(x) - len(self._relations.shapes) :] = self._shapes(x)
        # The encoder where the direction is by one: a position fault does not touch the speed.
        speed, rate = self._speeds(value, first)
        way, moving = self._way(len(rows), x, (speed, rate))
        if self._layout.direction >= 0:
            x[self._layout.direction] = way
        supplies = self._relations.functions["supplies"](self._p, x)
        before = self._stores.follow(rows, supplies, self._period_s, frozen, values)
        if self._layout.winding >= 0:
            x[self._layout.winding] = self._warm(before)
        return x, (speed, way), moving

    def _speeds(self, value: Any, first: Any) -> tuple[Value, Value]:
        """Speed, and slope of the position; numbers of one scan, else columns."""
        position, encoder = self._layout.position, self._layout.encoder
        rate = first[position] if position >= 0 else math.nan * first[0]
        return value[encoder] * self._p.encoder_m_per_rad if self.has_encoder else rate, rate

    def _way(
        self, count: int, x: list[Value], speeds_m_s: tuple[Value, Value]
    ) -> tuple[Value, Flags]:
        """Smooth sign of the motion, or of the push where it is stalled; whether it is either."""
        speed, rate = speeds_m_s
        moving = np.empty(count, dtype=bool)
        moving[:] = (abs(speed) > self._moving_m_s) | (abs(rate) > self._moving_m_s)
        push, dry = self._relations.functions["drag"](self._p, x)
        stands = ~moving & (abs(speed) <= self._moving_m_s)  # and not: no speed is known
        stalled = self._rests(stands) & (abs(push) > STALL * dry)
        way = np.where(stalled, np.copysign(1.0, push), self._direction(x, speed))
        return float(way[0]) if count == 1 else way, moving | stalled

    def _direction(self, x: list[Value], speed_m_s: Value) -> Value:
        """Smooth sign of the speed: a shape where a relation holds it."""
        place = self._layout.direction
        return x[place] if place >= 0 else direction(self._p, speed_m_s)

    def _rests(self, stands: Flags) -> Flags:
        """Whether it has stood for longer than the kernel is: a reversal is no standstill."""
        scans = np.arange(len(stands))
        still = scans - np.maximum.accumulate(np.where(stands, -1 - self._still, scans))
        self._still = int(still[-1])
        rests: Flags = still > self._kernel_length
        return rests

    def _warm(self, before: Array) -> Value:
        """The predicted temperature of the winding, from estimates before each scan."""
        store, cold = self._winding
        if store < 0:
            return cold
        warm = np.where(np.isnan(before[store]), cold, before[store])
        return float(warm[0]) if len(warm) == 1 else warm

    def _parities(self, way: Value, x: list[Value], values: Array, spread: Array) -> None:
        """Fill in every parity relation and what healthy units differ by in it."""
        sign = (math if len(values) == 1 else np).copysign(1.0, way)
        formed = self._relations.functions["relations"](self._p, x)
        apart = self._relations.functions["spreads"](self._p, x)
        for place, row, normalised in self._layout.values:
            values[:, place] = sign * formed[row] if normalised else formed[row]
        for place, row, normalised in self._layout.spreads:
            factor = sign if normalised else 1.0
            for k, column in enumerate(apart[row]):
                spread[:, place, k] = factor * column


def _columns(smooth: Array) -> Any:
    """Value, first and second derivative of each channel: numbers of one scan, else columns."""
    if len(smooth) == 1:
        return smooth[0].tolist()
    return np.ascontiguousarray(smooth.transpose(1, 2, 0))


def _table(columns: Sequence[Value], count: int) -> Array:
    """Numbers or columns side by side, shape (n, columns)."""
    table = np.empty((count, len(columns)))
    for number, column in enumerate(columns):
        table[:, number] = column
    return table
