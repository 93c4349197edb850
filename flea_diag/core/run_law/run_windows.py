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

"""Means of one recording over windows: residuals, and the signals by which they may differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import accumulate

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.symbolic.expression import derivative, evaluate, symbols

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

WINDOW_S = 0.2
"""Five windows a second: the shortest delay that matters."""
CURRENT_RATE, CURRENT_WAY, CURRENT_HEAT = "current_rate", "current_way", "current_by_heat"
CURRENT_ZERO = "current_zero"
LOAD_DRAG, REVERSAL = "load_drag", "reversal"
BY_PLACE = ("by_place", "by_place_squared")
LOAD_BY_PLACE = ("load_by_place", "load_by_place_squared")
WAY_BY_PLACE = ("way_by_place", "way_by_place_squared")
FORMED = (
    CURRENT_RATE, CURRENT_WAY, CURRENT_HEAT, CURRENT_ZERO, LOAD_DRAG, REVERSAL,
    *BY_PLACE, *LOAD_BY_PLACE, *WAY_BY_PLACE,
)  # fmt: skip
"""Signals of the law behind those of the faults, in the order of ``left_out``."""
HEATING_S = 60.0
"""Time for which a winding keeps its losses: an assumption, windings have half a minute to two."""
PLACE = "place"
"""Column of a table of regressors: where along the stroke the machine is."""
TURNS = 0.99
"""Share of the full sign of the motion below which a window holds a reversal or a standstill."""
MOTIONS = ("turning", "load", "speed", "acceleration", "jerk")
"""What the noise grows with: sensors lag behind each other, and no description is exact."""


def window_scans(period_s: float) -> int:
    """Scans of one window."""
    return max(1, round(WINDOW_S / period_s))


def zeroed(values: Array) -> Array:
    """The same with 0 where there is none: ``nan_to_num`` takes five times as long for a window."""
    return np.where(np.isnan(values), 0.0, values)


class WindowMotion:
    """How a machine moves, window by window."""

    def __init__(self) -> None:
        self._speed: float | None = None
        self._change: float | None = None

    def steps(self, direction: Array, load: Array, speed: Array) -> Array:
        """Of the scans of the next windows, each of shape (windows, scans); by ``MOTIONS``.

        1 with a reversal or a standstill; squares of the mean load and speed, of the change of the
        speed over the window and of the change of that from the window before.
        """
        if not len(speed):
            return np.empty((0, len(MOTIONS)))
        direction, load, speed = map(zeroed, (direction, load, speed))
        last = speed[:, -1]
        change = np.diff(last, prepend=speed[0, 0] if self._speed is None else self._speed)
        jerk = np.diff(change, prepend=change[0] if self._change is None else self._change)
        self._speed, self._change = float(last[-1]), float(change[-1])
        way, loads, speeds = (each.mean(axis=1) for each in (direction, load, speed))
        turning = (np.abs(way) < TURNS).astype(np.float64)
        return np.asarray(np.square(np.column_stack((turning, loads, speeds, change, jerk))))


@dataclass(frozen=True, eq=False)
class RunWindows:
    """One recording in windows of ``WINDOW_S``.

    Attributes
    ----------
    name, unit
        Of the recording, and the serial number of its actuator; empty: not known.
    values
        Residuals, shape (windows, relations), NaN where most scans of a window have none.
    signals
        Means over the scans in which each residual has a value, shape (windows, relations,
        signals).
    motion
        What the noise grows with, shape (windows, ``MOTIONS``).
    """

    name: str
    unit: str
    values: Array
    signals: Array
    motion: Array

    def __len__(self) -> int:
        return len(self.values)

    def part(self, windows: slice) -> RunWindows:
        """Some of the windows, as a recording of its own."""
        values, signals = self.values[windows], self.signals[windows]
        return RunWindows(self.name, self.unit, values, signals, self.motion[windows])


def speed_signal(rows: ResidualSet) -> str:
    """Name of the signal that is the speed: the rate of the position, where there is one."""
    *_, speed, rate = motion_signals(rows)
    return rate if rows.position else speed


def usual_speed(runs: Sequence[RunWindows], effects: EffectSet, relations: Sequence[str]) -> float:
    """Median speed of windows in motion, in the unit of its signal; 0 where none is known."""
    friction = effects.residuals.friction
    if friction not in relations:
        return 0.0
    place, signal = relations.index(friction), speed_signal(effects.residuals)
    column = effects.names.index(signal)
    moved = [run.signals[np.isfinite(run.values[:, place]), place, column] for run in runs]
    return float(np.median(np.abs(np.concatenate(moved)))) if any(map(len, moved)) else 0.0


def signal_names(effects: EffectSet) -> tuple[str, ...]:
    """The basis signals, and what the relations leave out."""
    return (*effects.names, *FORMED)


def current_side(effects: EffectSet) -> str:
    """Name of the signal that is the smooth sign of the current; empty where none is known."""
    shapes, current = effects.relations.shapes, effects.residuals.current
    sides = (n for n, shape in shapes.items() if current and current in symbols(shape.argument))
    return next((name for name in sides if name in effects.names), "")


def with_neglected(regressors: Array, effects: EffectSet, period_s: float, place: Array) -> Array:
    """Basis signals of n scans, shape (n, signals), and behind them what relations leave out.

    ``place`` along the stroke, shape (n,), as of ``along``.
    """
    current, load, way = (_column(regressors, effects, name) for name in motion_signals(
        effects.residuals)[:3])  # fmt: skip
    rate = np.diff(current, prepend=current[:1]) / period_s
    heat = losses(current, 0.0, period_s)
    name = current_side(effects)
    side = _column(regressors, effects, name) if name else None
    behind = left_out(current, rate, heat, load, way, place, side)
    return np.concatenate((regressors[:, : len(effects.names)], behind), axis=-1)


def place_of(readings: Array, rows: ResidualSet) -> Array:
    """Places along the stroke, shape (n,); NaN where this stand reads none."""
    if not rows.position:
        return np.full(len(readings), math.nan)
    return readings[:, rows.index[rows.position]]


def along(places: Array, travel: tuple[float, ...]) -> Array:
    """Places along the stroke: -1 and 1 at the ends of the healthy travel, 0 where not known."""
    if not travel or travel[0] == travel[1]:
        return np.zeros(len(places))
    low, high = travel
    return np.nan_to_num(np.clip((2.0 * places - low - high) / (high - low), -1.0, 1.0))


def losses(current: Array, before: float, period_s: float, compiled: bool = False) -> Array:
    """Integral of the squared current, fading by ``HEATING_S``, A^2 s, shape (n,).

    ``before``: up to the first scan. Added one by one: the same bits whatever the blocks, and
    whether ``compiled`` by numba.
    """
    kept = math.exp(-period_s / HEATING_S)
    heat: Array = np.square(np.nan_to_num(current)) * period_s
    if compiled:
        backends.exact(fading_loops)(heat, kept, before)
        return heat
    every = accumulate(heat.tolist(), lambda sum_, more: kept * sum_ + more, initial=before)
    return np.array(list(every)[1:])


def fading_loops(sums: Array, kept: float, before: float) -> None:
    """Numbers, shape (n,), into their sums up to each, of which so much is kept to the next."""
    for k in range(len(sums)):
        before = kept * before + sums[k]
        sums[k] = before


def left_out(
    current: Array, rate: Array, heat: Array, load: Array, way: Array, place: Array,
    side: Array | None = None,
) -> Array:  # fmt: skip
    """What relations leave out, shape (..., ``FORMED``).

    The rate of the current, by which a winding's inductance acts, or two channels of the circuit
    that lag behind each other; its sign, by which the dead time of a bridge acts; the current times
    the losses of late, which warm a winding more than its thermometer says; the slope of ``side``,
    the smooth sign of the current, by which an error of its zero acts; the load times the sign
    of the motion, by which a load rubs; what the smooth sign of the motion leaves out at a
    reversal, where dry friction has its peak; and how a load, lever arms and friction change along
    the stroke.
    """
    # Legendre polynomials: over the travel neither looks like the load or the way alone.
    apart = place, 1.5 * np.square(place) - 0.5
    changing = (signal * by for signal in (np.ones_like(way), load, way) for by in apart)
    turn = way * (1.0 - np.square(way))
    slope = np.zeros_like(current) if side is None else 1.0 - np.square(side)
    electric = rate, np.sign(current), current * heat, slope
    return np.stack((*electric, np.abs(load) * way, turn, *changing), axis=-1)


def side_slope(signals: Array) -> Array:
    """Slope of the smooth sign of the current, 0 to 1, shape (...); signals: (..., signals).

    0 where they are without what relations leave out.
    """
    if signals.shape[-1] < len(FORMED):
        return np.zeros(signals.shape[:-1])
    return np.asarray(signals[..., FORMED.index(CURRENT_ZERO) - len(FORMED)])


def own_name(relation: str, signal: str) -> str:
    """Name of a signal as a relation itself says that it should be."""
    return f"{relation}: {signal}"


def answering(
    effects: EffectSet, parameters: ActuatorParameters, relations: tuple[str, ...]
) -> Iterator[tuple[int, int, float]]:
    """Place of a relation, column of the signal that answers in it, and its gain there.

    The voltage answers to current and speed, the current to load and friction. So such a signal
    carries the noise of its own relation, and a share of it would explain a share of any noise.
    What the rest of the relation says that it should be carries none.
    """
    rows, signals = effects.residuals, effects.relations.signals
    values = asdict(parameters)
    for row in effects.relations.relations:
        if row.name not in relations or row.kind != "junction":
            continue
        answer = rows.voltage if row.name == rows.circuit else rows.current
        if answer not in row.signals:
            continue
        gain = derivative(row.expression, answer)
        if not set(symbols(gain)) & set(signals):
            yield relations.index(row.name), signals.index(answer), float(evaluate(gain, values))


def windows_of(
    name: str, unit: str, values: Array, signals: Array, motion: tuple[Array, Array, Array],
    scans: int,
) -> RunWindows:  # fmt: skip
    """Windows of so many scans; what is left at the end is dropped.

    Parameters
    ----------
    values, signals
        Of each scan, shape (n, relations) and (n, relations, signals).
    motion
        Smooth sign of the motion, load and speed, each of shape (n,).
    """
    count = len(values) // scans
    values = values[: count * scans].reshape(count, scans, values.shape[1])
    signals = np.nan_to_num(signals[: count * scans]).reshape(count, scans, *signals.shape[1:])
    known = np.isfinite(values)
    found = known.sum(axis=1)
    share = known / np.maximum(found, 1)[:, None]
    means = (np.nan_to_num(values) * share).sum(axis=1)
    means[2 * found <= scans] = np.nan
    every = (each[: count * scans].reshape(count, scans) for each in motion)
    moved = WindowMotion().steps(*every)
    return RunWindows(name, unit, means, np.einsum("tnr,tnrs->trs", share, signals), moved)


def in_motion_only(
    values: Array, moving: Flags, rows: ResidualSet, names: tuple[str, ...]
) -> Array:
    """Residuals without those that mean nothing at rest, where the actuator rests."""
    gated = np.array([name in rows.in_motion for name in names], dtype=bool)
    return np.where(gated & ~moving[:, None], np.nan, values)


def _column(regressors: Array, effects: EffectSet, name: str) -> Array:
    """A signal of the motion; 0 where this stand does not read it."""
    column = regressors[:, effects.names.index(name)]
    return np.nan_to_num(column)
