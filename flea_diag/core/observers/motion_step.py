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

"""One scan of the driven model for all particles: one source for numpy and numba.

    v' = -lambda v + N(v)

The linear part is exact for inputs held over a scan; the rest takes the two-stage exponential rule
of ``bond_graph.discretisation`` (Cox and Matthews 2002). Current and encoder speed are means over a
scan where the DAQ averages, so the mean speed of the scan is a state of its own.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.discretisation import phi_functions

Array = npt.NDArray[np.float64]


class MotionCoefficients(NamedTuple):
    """Numbers of the driven model at one winding temperature.

    The current as (per volt, per speed, 1), the acceleration as (per ampere, per speed, per newton,
    1), and what follows from both for one period.
    """

    period_s: float
    amperes: tuple[float, float, float]
    pushes: tuple[float, float, float, float]
    per_volt: float
    at_rest: float
    decay: float
    gained: float
    """Speed gained in a scan per unit of acceleration."""
    kept: float
    averaged: float
    """Mean speed gained per unit of acceleration."""

    @classmethod
    def of(
        cls,
        amperes: tuple[float, float, float],
        pushes: tuple[float, float, float, float],
        period_s: float,
    ) -> MotionCoefficients:
        """From the linear part of the state equations."""
        damping = -(pushes[0] * amperes[1] + pushes[1])
        one, two = phi_functions(-damping * period_s)
        decay, per_volt = math.exp(-damping * period_s), pushes[0] * amperes[0]
        at_rest = pushes[0] * amperes[2] + pushes[3]
        step = decay, period_s * one, one, period_s * two
        return cls(period_s, amperes, pushes, per_volt, at_rest, *step)


def put(row: Array, values: Array) -> None:
    """Values into a row."""
    row[:] = values


def put_loops(row: Array, values: Array) -> None:
    """``put`` for numba, which compiles the words of an error of shapes into an assignment."""
    for k in range(len(row)):
        row[k] = values[k]


def friction(p: Any, x: Any) -> Any:
    """In place of the function that only a set of relations has: see ``driven_model``."""
    raise AssertionError("the step runs with the friction of a relation set")


def motion_step(
    x: Array, u: Array, pwm: bool, c: MotionCoefficients, parameters: Any, new: Array
) -> None:
    """States one period later into ``new``, (4, N) -> (4, N).

    Without a voltage, or with raw PWM, the state's own is held; without a load it is in balance
    with what the motor does.
    """
    p, speed = parameters[0], x[2]
    put(new[0], x[0])
    if not pwm and not math.isnan(u[0]):
        new[0] = u[0]
    # A load of each particle in either case: compiled code has one form of what follows.
    load = np.zeros_like(speed)
    if math.isnan(u[1]):
        current = c.amperes[0] * x[0] + c.amperes[1] * x[1] + c.amperes[2]
        push = c.pushes[0] * current + c.pushes[1] * speed + c.pushes[3]
        load = -(push + friction(p, (speed, load))[0]) / c.pushes[2]
    else:
        load[:] = u[1]
    moved(x, load, c, p, new)


def moved(x: Array, load: Array, c: MotionCoefficients, p: Any, new: Array) -> None:
    """``motion_step`` with the voltage in place, and a load of each particle."""
    speed = x[2]
    drive = c.per_volt * new[0] + (c.pushes[2] * load + c.at_rest)
    first = drive + friction(p, (speed, load))[0]
    half = c.decay * speed + c.gained * first
    second = drive + friction(p, (half, load))[0] - first
    put(new[1], c.kept * speed + c.averaged * (first + 0.5 * second))
    put(new[2], half + c.averaged * second)
    put(new[3], x[3] + c.period_s * new[1])
