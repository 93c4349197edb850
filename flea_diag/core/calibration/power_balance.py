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

"""Signs by the balance of power: what a drive takes in covers its losses and the work that it does.

With a voltage u, current i, speed v of the moved part and an opposing load F, all extending when
positive:

    u = R i + K v,   R > 0 (copper loss), K > 0 (work of the motor)
    i = c sgn(v) + d v + m dv/dt + b F,   c > 0 (friction), b > 0 (work against the load)
    i = c |v| + b F v for the current of a supply, which never turns with the direction

A coefficient of the wrong sign, far beyond its error, says that one of its two signals is turned.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VOLTAGE, CURRENT, POSITION, SPEED, LOAD = "voltage", "current", "position", "speed", "load"
ROLES = (POSITION, CURRENT, VOLTAGE, SPEED, LOAD)
SMOOTHED_S = 0.2
"""Length over which readings are averaged: a voltage sampled as raw PWM becomes its mean."""
MOVING = 0.15
"""Share of the largest speed from which on the part counts as moving."""
ONE_WAY = 0.02
"""Share of its readings in which the current of a supply may be negative."""
FEWEST_ROWS = 50  # assumption: size of a sample
LARGEST = 1e12
"""Readings beyond it are errors, whatever the unit."""


@dataclass(frozen=True)
class SignRelation:
    """Two signals whose signs belong together.

    Parameters
    ----------
    one, other
        Roles of the signals.
    slope
        Coefficient that must be positive, in the units of the signals.
    certainty
        ``slope`` divided by its standard error.
    meaning
        What the coefficient is.
    """

    one: str
    other: str
    slope: float
    certainty: float
    meaning: str


def smoothed(values: Array, period_s: float) -> Array:
    """Running mean over ``SMOOTHED_S``, shape (n,); NaN at the ends and about a NaN."""
    length = max(3, 2 * round(0.5 * SMOOTHED_S / period_s) + 1)
    found = np.full(len(values), np.nan)
    if len(values) >= length:
        mean = np.convolve(values, np.full(length, 1.0 / length), "valid")
        found[length // 2 : length // 2 + len(mean)] = mean
    return found


def rate_of(values: Array, period_s: float) -> Array:
    """Derivative of smoothed values by time, shape (n,)."""
    return np.gradient(values, period_s) if len(values) > 2 else np.full(len(values), np.nan)


def is_supply_current(current: Array, position: Array, period_s: float) -> bool:
    """Whether a current is that of a supply: never fed back, and more either way than at rest."""
    finite = current[np.isfinite(current)]
    if not len(finite) or float(np.mean(finite < 0.0)) >= ONE_WAY:
        return False
    mean, speed = smoothed(current, period_s), rate_of(smoothed(position, period_s), period_s)
    moving = _moving(speed)
    ways = [mean[moving & (speed > 0.0)], mean[moving & (speed < 0.0)]]
    rest = mean[np.isfinite(speed) & ~moving]
    rest = rest[np.isfinite(rest)]
    if len(rest) < FEWEST_ROWS:
        return True
    return all(float(np.nanmean(way)) > float(np.mean(rest)) for way in ways if len(way))


def fitted(target: Array, columns: Sequence[Array], spread: float) -> list[tuple[float, float]]:
    """Slopes of a least-squares fit with an offset, each with its slope over its error.

    ``spread``: samples that a smoothed reading is spread over, so that many count as one.
    """
    table = np.column_stack([*columns, np.ones(len(target))])
    use = np.isfinite(table).all(axis=1) & np.isfinite(target)
    count = int(use.sum())
    if count < max(FEWEST_ROWS, 4 * table.shape[1]):
        return [(np.nan, 0.0)] * len(columns)
    table, target = table[use], target[use]
    scale = np.linalg.norm(table, axis=0)
    scale[scale == 0.0] = 1.0
    solved, _, rank, _ = np.linalg.lstsq(table / scale, target, rcond=1e-6)
    if rank < table.shape[1]:
        return [(np.nan, 0.0)] * len(columns)
    residual = target - (table / scale) @ solved
    variance = float(residual @ residual) / max(1.0, count / spread - table.shape[1])
    inverse = np.linalg.inv((table / scale).T @ (table / scale))
    errors = np.sqrt(variance * np.diag(inverse)) + 1e-300
    return [(float(x / s), float(x / e)) for x, e, s in zip(solved, errors, scale, strict=True)][
        : len(columns)
    ]


def sign_relations(signals: Mapping[str, Array], period_s: float) -> list[SignRelation]:
    """Relations that these signals close, each an array of readings of one grid."""
    known = {r: np.where(np.abs(values) < LARGEST, values, np.nan) for r, values in signals.items()}
    mean = {role: smoothed(values, period_s) for role, values in known.items()}
    if POSITION not in mean:
        return []
    speed = rate_of(mean[POSITION], period_s)
    spread = max(3.0, 2.0 * SMOOTHED_S / period_s)
    found = []
    if SPEED in mean:
        ((slope, sure),) = fitted(mean[SPEED], [speed], spread)
        found.append(SignRelation(SPEED, POSITION, slope, sure, "speed by rate of position"))
    if CURRENT in mean and is_supply_current(known[CURRENT], known[POSITION], period_s):
        found += _of_supply(mean, speed, spread)
    elif CURRENT in mean:
        found += _of_circuit(mean, speed, spread)
        found += _of_forces(mean, speed, rate_of(speed, period_s), spread)
    return [relation for relation in found if np.isfinite(relation.slope)]


def _of_circuit(mean: Mapping[str, Array], speed: Array, spread: float) -> Iterator[SignRelation]:
    if VOLTAGE not in mean:
        return
    one, other = fitted(mean[VOLTAGE], [mean[CURRENT], speed], spread)
    yield SignRelation(VOLTAGE, CURRENT, *one, "copper loss: voltage by current")
    yield SignRelation(VOLTAGE, POSITION, *other, "back-EMF: voltage by speed")


def _moving(speed: Array) -> npt.NDArray[np.bool_]:
    finite = np.abs(speed[np.isfinite(speed)])
    most = float(np.quantile(finite, 0.98)) if len(finite) else 0.0
    return np.asarray(np.abs(speed) > MOVING * most)


def _of_forces(
    mean: Mapping[str, Array], speed: Array, gain: Array, spread: float
) -> Iterator[SignRelation]:
    way = np.where(_moving(speed), np.sign(speed), np.nan)
    if LOAD not in mean:
        drag, _ = fitted(mean[CURRENT], [way, gain], spread)
        yield SignRelation(CURRENT, POSITION, *drag, "friction: current by direction")
        return
    drag, _, _ = fitted(mean[CURRENT], [way, gain, mean[LOAD]], spread)
    # Viscous friction apart, which a load that goes with the speed would take for its own.
    *_, load = fitted(mean[CURRENT], [way, gain, speed, mean[LOAD]], spread)
    if not load[1]:
        drag, _ = fitted(mean[CURRENT], [way, gain], spread)
    yield SignRelation(CURRENT, POSITION, *drag, "friction: current by direction")
    yield SignRelation(CURRENT, LOAD, *load, "work on the load: current by load")


def _of_supply(mean: Mapping[str, Array], speed: Array, spread: float) -> Iterator[SignRelation]:
    if LOAD not in mean:
        return
    _, work = fitted(mean[CURRENT], [np.abs(speed), speed * mean[LOAD]], spread)
    yield SignRelation(LOAD, POSITION, *work, "work on the load: supply current by power")


def turned(
    relations: Sequence[SignRelation], roles: Sequence[str], fixed: Sequence[str] = ()
) -> tuple[frozenset[str], ...]:
    """Signals whose signs must be turned for the relations to hold: the fewest; all such choices.

    ``fixed`` signals are right as they are.

    Relations that contradict one another are satisfied as far as their certainty goes.
    """
    known = [role for role in ROLES if role in roles and role not in fixed]
    choices = [
        frozenset(some)
        for count in range(len(known) + 1)
        for some in itertools.combinations(known, count)
    ]
    merit = {some: _merit(relations, some) for some in choices}
    most = max(merit.values(), default=0.0)
    best = [some for some in choices if merit[some] >= most - 1e-9]
    return tuple(some for some in best if len(some) == len(best[0]))


def _merit(relations: Sequence[SignRelation], flipped: frozenset[str]) -> float:
    total = 0.0
    for relation in relations:
        sign = -1.0 if (relation.one in flipped) != (relation.other in flipped) else 1.0
        total += sign * float(np.clip(relation.certainty, -20.0, 20.0))
    return total
