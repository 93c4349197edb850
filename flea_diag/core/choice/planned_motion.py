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

"""Motions that an operator may be asked for, and the signals that a healthy actuator would show.

The motion gives the position, its rates and the load; each relation with one unknown signal left
gives that signal, until none is left to find: inverse dynamics by the relations that run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residuals.leverage import CalibrationEnvelope
from flea_diag.core.residuals.measured_graph import rate_symbol, time_derivative
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import CompiledRelation, RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.scan_counts import COUNTED_PERIOD_S
from flea_diag.core.symbolic.collect import solved_for
from flea_diag.core.symbolic.expression import Function, derivative, evaluate, symbols

Array = npt.NDArray[np.float64]

ROOM_DEGC = 25.0  # of a planned motion, which no stand has to follow


@dataclass(frozen=True)
class PlannedMotion:
    """A reciprocating motion, sinusoidal in position about ``middle_m``, under a constant load."""

    name: str
    peak_m_s: float
    period_s: float
    load_n: float
    seconds: float
    middle_m: float = 0.05
    scan_s: float = COUNTED_PERIOD_S


MOTIONS = (
    PlannedMotion("slow reciprocating, no load", 0.010, 8.0, 0.0, 8.0),
    PlannedMotion("fast reciprocating, no load", 0.040, 4.0, 0.0, 8.0),
    PlannedMotion("slow reciprocating, load 200 N", 0.010, 8.0, 200.0, 8.0),
    PlannedMotion("slow reciprocating, load -200 N", 0.010, 8.0, -200.0, 8.0),
    PlannedMotion("fast reciprocating, load 200 N", 0.040, 4.0, 200.0, 8.0),
    PlannedMotion("fast reciprocating, load -200 N", 0.040, 4.0, -200.0, 8.0),
)
"""Within stroke, speed and load of the FLEA (0.1 m, 0.08 m/s, 311 N)."""
PACES = (("slow", 0.125, 8.0), ("fast", 0.5, 4.0))
"""Pace, share of the largest speed, longest period."""
LOAD_SHARE, STROKE_SHARE = 0.6, 0.4
"""Of the largest load either way, and most of the calibrated stroke either way."""


def motions_within(
    known: ResidualSet, envelope: CalibrationEnvelope | None, scan_s: float
) -> tuple[PlannedMotion, ...]:
    """Motions within what a calibration has seen; those of the FLEA where it does not say.

    ``scan_s`` is the period of the scans.
    """
    place = envelope.ranges.get(known.position) if envelope else None
    speed = envelope.ranges.get(rate_symbol(known.position)) if envelope else None
    if envelope is None or place is None or speed is None:
        return tuple(replace(motion, scan_s=scan_s) for motion in MOTIONS)
    middle, reach = sum(place) / 2.0, STROKE_SHARE * (place[1] - place[0])
    unit = known.units.get(known.load, "")
    found = []
    for load in _loads(*envelope.ranges.get(known.load, (0.0, 0.0))):
        under = f"load {load:.3g} {unit}" if load else "no load"
        for pace, share, longest_s in PACES:
            peak = share * max(map(abs, speed))
            period_s = min(longest_s, 2.0 * math.pi * reach / peak)
            seconds = period_s * math.ceil(8.0 / period_s)
            name = f"{pace} reciprocating, {under}"
            found.append(PlannedMotion(name, peak, period_s, load, seconds, middle, scan_s))
    return tuple(found)


def _loads(low: float, high: float) -> tuple[float, ...]:
    """No load, and a share of the largest one either way; the least one that was always there."""
    if low > 0.0 or high < 0.0:
        return tuple(low + share * (high - low) for share in (1.0 - LOAD_SHARE, LOAD_SHARE))
    return (0.0, *(LOAD_SHARE * end for end in (high, low) if end))


def planned(
    effects: EffectSet, p: ActuatorParameters, motion: PlannedMotion, elapsed_s: float = 0.0
) -> Array:
    """Basis signals of each scan of a motion by the calibrated model, shape (scans, signals).

    To first order: currents are those of the healthy actuator. ``elapsed_s`` is the age of the
    fault at the start of the motion.
    """
    phi = _planned(effects, p, motion).copy()
    phi[:, effects.names.index("elapsed_s")] += elapsed_s
    return phi


@lru_cache(maxsize=64)
def _planned(effects: EffectSet, p: ActuatorParameters, motion: PlannedMotion) -> Array:
    times = np.arange(0.0, motion.seconds, motion.scan_s)
    known = signals(effects.relations, p, motion, times)
    known |= _shapes(effects.shapes, known)
    room = {name for name in effects.signals if name.endswith("_degc")}
    nothing = np.full(len(times), math.nan)
    x = [
        np.full(len(times), ROOM_DEGC) if name in room else np.asarray(known.get(name, nothing))
        for name in effects.signals
    ]
    phi = np.empty((len(times), len(effects.names)))
    for number, column in enumerate(effects.functions["columns"](p, x)):
        phi[:, number] = column
    phi[:, effects.names.index("elapsed_s")] = times
    return phi


def signals(
    relations: RelationSet, p: ActuatorParameters, motion: PlannedMotion, times_s: Array
) -> dict[str, Array]:
    """Parameters, and the signals that follow from position and load, shape as ``times_s``."""
    omega = 2.0 * math.pi / motion.period_s
    position, load = relations.residuals.position, relations.residuals.load
    rate = rate_symbol(position)
    known = {
        **asdict(p),
        **relations.reference,
        position: motion.middle_m + motion.peak_m_s / omega * np.sin(omega * times_s),
        rate: motion.peak_m_s * np.cos(omega * times_s),
        rate_symbol(rate): -motion.peak_m_s * omega * np.sin(omega * times_s),
        load: np.full(len(times_s), motion.load_n),
    }
    return completed(relations, known)


def completed(relations: RelationSet, known: Mapping[str, Array]) -> dict[str, Array]:
    """The same signals, and those that follow from them by the relations, as far as they go."""
    known, waiting = dict(known), list(relations.relations)
    while waiting:
        known |= _shapes(relations.shapes, known)
        ready = [(row, _unknown(row, known)) for row in waiting]
        solvable = [(row, names[0]) for row, names in ready if len(names) == 1]
        if not solvable:
            break
        for row, name in solvable:
            known |= _solved(row, name, known)
            waiting.remove(row)
        waiting = [row for row in waiting if _unknown(row, known)]
    return known


def _shapes(shapes: Mapping[str, Function], known: Mapping[str, Array]) -> dict[str, Array]:
    """Values of those shapes whose arguments are known."""
    ready = {name: shape for name, shape in shapes.items() if set(symbols(shape)) <= set(known)}
    return {name: evaluate(shape, known) for name, shape in ready.items()}


def _unknown(row: CompiledRelation, known: Mapping[str, Array]) -> list[str]:
    return [name for name in row.signals if name not in known]


def _solved(row: CompiledRelation, name: str, known: Mapping[str, Array]) -> dict[str, Array]:
    """A signal in which a relation is linear, and its rate where those of the others are known."""
    solution = solved_for(name, row.expression)
    if solution is None or not np.all(evaluate(derivative(row.expression, name), known)):
        return {}  # not linear, or a parameter that is 0 makes it of no size
    found = {name: evaluate(solution, known)}
    constants = frozenset(symbols(solution)) - frozenset(row.signals)
    rate = time_derivative(solution, constants)
    if set(symbols(rate)) <= set(known):
        found[rate_symbol(name)] = evaluate(rate, known)
    return found
