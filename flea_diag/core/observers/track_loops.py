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

"""Many scans in one compiled call: the driven model, particle filter and temperatures.

For numba, as ``particle_loops``. A scan alone goes through here too, as a block of one: the same
machine code gives the same bits in whatever blocks the scans come.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.motion_step import MotionCoefficients, motion_step, put_loops
from flea_diag.core.observers.normal_table import Indices
from flea_diag.core.observers.particle_kernel import Array
from flea_diag.core.observers.particle_loops import STEP, step_loops
from flea_diag.core.observers.resampling_loops import exp_loops
from flea_diag.core.observers.thermal_filter import ESTIMATE, heat_loops

Flags = npt.NDArray[np.bool_]

LOST, WARMED = 1, 2
"""Nothing of what was predicted fits; the winding is so much warmer that its model changes."""


def tanh_loops(v: Array) -> Array:
    """Hyperbolic tangents, exact to some 1e-16 of one."""
    fall, found = np.empty_like(v), np.empty_like(v)
    for i in range(len(v)):
        twice = -2.0 * abs(v[i])
        fall[i] = -700.0 if twice < -700.0 else twice
    exp_loops(fall, found)
    for i in range(len(v)):
        found[i] = math.copysign((1.0 - found[i]) / (1.0 + found[i]), v[i])
    return found


def supplies(p: Any, x: Any) -> Any:
    """In place of the function that only a set of relations has: see ``driven_model``."""
    raise AssertionError("the loop runs with the supplies of a relation set")


def track_loops(
    x: Array, cloud: Array, scans: tuple[Array, Array, Array, Array],
    pattern: tuple[Flags, Array, Array], bits: tuple[Array, Indices], table: Array,
    threshold: float, motion: tuple[bool, MotionCoefficients, Any],
    heat: tuple[Array, tuple[int, float, float]], frozen: bool, begun: bool, out: Array,
) -> tuple[int, int]:  # fmt: skip
    """Scan after scan until one needs what is not compiled; see ``observer_block``.

    Particles, cloud and stores are renewed in place; ``heat`` are the stores, and which of them is
    the winding (-1: none), the temperature that its resistance is taken at, and by how much it may
    change. Particles that have ``begun`` with the first of the scans are not moved in it. With a
    scan whose missing inputs or channels are not those of ``pattern`` nothing has been done.

    Returns
    -------
    How many scans were taken, and with what the last of them ended it: ``LOST``, ``WARMED``, 0.
    """
    U, Y, held, readings = scans
    known, flat, idle = pattern
    uniform, chosen = bits
    pwm, coefficients, parameters = motion
    stores, (winding, degc, warmed) = heat
    n, p = len(x), Y.shape[1]
    moved, apart = np.empty_like(x), np.empty_like(cloud)
    spare = np.empty(3 * p + n + 2)
    at = len(spare)
    for k in range(len(uniform)):
        u, told, seed, drawn = U[k], out[k, :at], uniform[k], chosen[k]
        for b in range(len(u)):
            if math.isnan(u[b]) == known[b]:
                return k, 0
        if begun and not k:
            put_loops(moved.reshape(-1), x.reshape(-1))
        else:
            motion_step(x, u, pwm, coefficients, parameters, moved)
        put_loops(apart.reshape(-1), cloud.reshape(-1))
        # Frozen, it is compared with all, then moved by what drives it alone. One call in a loop:
        # compiled, each call is all of the step once more.
        for turn in range(2 if frozen else 1):
            y, packed, said = Y[k], flat, told
            if turn:
                y, packed, said = held[k], idle, spare
            weights = apart if frozen and not turn else cloud
            if not step_loops(moved, weights, x, y, u, packed, seed, drawn, table, threshold, said):
                return k, 0
        if frozen:
            for c in range(3 * p, at - 2):
                told[c] = spare[c]
        flows = supplies(parameters[0], (told[3 * p], told[3 * p + 1], degc))
        for j in range(len(stores)):
            end = at + 4 * (j + 1)
            heat_loops(stores[j], readings[k], j, flows[j], frozen, out[k, end - 4 : end])
        end = 0 if frozen or math.isfinite(told[at - 2]) else LOST
        if winding >= 0 and abs(stores[winding, ESTIMATE] - degc) > warmed:
            end |= WARMED
        if end:
            return k + 1, end
    return len(uniform), 0


TANH = {"tanh": tanh_loops}
"""Shapes that vectorise, by the names in generated code."""
TRACK = (*STEP, heat_loops)
"""What ``track_loops`` calls beside the step of a set of relations."""
