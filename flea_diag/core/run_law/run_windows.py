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

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet, motion_signals
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.symbolic.expression import derivative, evaluate, symbols

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

WINDOW_S = 0.2
"""Five windows a second: the shortest delay that matters."""
CURRENT_RATE, LOAD_DRAG, REVERSAL = "current_rate", "load_drag", "reversal"
FORMED = (CURRENT_RATE, LOAD_DRAG, REVERSAL)
"""Signals of the law behind those of the faults, in the order of ``with_neglected``."""
TURNS = 0.99
"""Share of the full sign of the motion below which a window holds a reversal or a standstill."""


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
    turning
        Windows with a reversal or a standstill, shape (windows,).
    """

    name: str
    unit: str
    values: Array
    signals: Array
    turning: Flags

    def __len__(self) -> int:
        return len(self.values)

    def part(self, windows: slice) -> RunWindows:
        """Some of the windows, as a recording of its own."""
        values, signals = self.values[windows], self.signals[windows]
        return RunWindows(self.name, self.unit, values, signals, self.turning[windows])


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


def with_neglected(regressors: Array, effects: EffectSet, period_s: float) -> Array:
    """Basis signals of n scans, shape (n, signals), and behind them what relations leave out.

    The rate of the current, by which a winding's inductance acts, or two channels of the circuit
    that lag behind each other; the load times the sign of the motion, by which a load rubs; and
    what the smooth sign of the motion leaves out at a reversal, where dry friction has its peak.
    """
    current, load = (_column(regressors, effects, name) for name in motion_signals(
        effects.residuals)[:2])  # fmt: skip
    rate = np.diff(current, prepend=current[:1]) / period_s
    way = _column(regressors, effects, DIRECTION)
    drag = np.abs(load) * way
    turn = way * (1.0 - np.square(way))
    return np.column_stack((regressors[:, : len(effects.names)], rate, drag, turn))


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
    name: str, unit: str, values: Array, signals: Array, direction: Array, scans: int
) -> RunWindows:
    """Windows of so many scans; what is left at the end is dropped.

    Parameters
    ----------
    values, signals
        Of each scan, shape (n, relations) and (n, relations, signals).
    direction
        Smooth sign of the motion, shape (n,).
    """
    count = len(values) // scans
    values = values[: count * scans].reshape(count, scans, values.shape[1])
    signals = np.nan_to_num(signals[: count * scans]).reshape(count, scans, *signals.shape[1:])
    known = np.isfinite(values)
    found = known.sum(axis=1)
    share = known / np.maximum(found, 1)[:, None]
    means = (np.nan_to_num(values) * share).sum(axis=1)
    means[2 * found <= scans] = np.nan
    way = np.nan_to_num(direction[: count * scans]).reshape(count, scans)
    turning = np.abs(way.mean(axis=1)) < TURNS
    return RunWindows(name, unit, means, np.einsum("tnr,tnrs->trs", share, signals), turning)


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
