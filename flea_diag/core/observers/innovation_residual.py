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

"""Innovations of the state observer as residuals, y - ŷ over its expected standard deviation.

They detect, and isolate nothing. A filter that corrects itself smears a faulty sensor into all
of its innovations, so their signs are those of no fault; once it is frozen, after a detection,
its open integral of the speed drifts away. Isolation is left to relations without a state
(Narasimhan et al. 2010, section 3.1, for detection).

``output_loops`` is the output of the state observer as a loop for numba, to the same bits: in
numpy it is ``stages.state_estimate.StateEstimate`` with ``normalised``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.observers.driven_model import STATES
from flea_diag.core.observers.observer_block import Innovations

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SPEED = STATES.index("speed_m_s")
TESTED, FIRST = (0,), 0
"""In place of those of a stand: see ``output_of``."""


def normalised(told: Innovations, tested: tuple[int, ...]) -> Array:
    """Innovations over their sigmas, each as it is and times the sign of the estimated speed.

    Shape (scans, columns), order of ``ResidualSet.innovations``; NaN where nothing was measured.
    ``tested`` are the places of the channels whose innovations are tested.
    """
    sigma = told.sigmas.take(tested, axis=1)
    sigma[~(sigma > 0.0)] = math.nan
    found = np.empty((len(sigma), 2 * len(tested)))
    np.divide(told.residuals.take(tested, axis=1), sigma, out=found[:, ::2])
    sign = np.copysign(1.0, told.means[:, SPEED, None])
    np.multiply(found[:, ::2], sign, out=found[:, 1::2])
    return found


def output_loops(
    innovations: tuple[int, Array, Counts, Flags], rows: Array, voltage: tuple[bool, int],
    frozen: bool, channels: Counts, told: tuple[Array, Array, Array], values: Array,
) -> None:  # fmt: skip
    """Scan after scan into ``told``, estimates, sigmas and health, and into the residuals.

    ``channels`` are those reported; ``voltage`` whether it is raw PWM, and the column of ``rows``
    whose command corroborates it (-1: none): else no innovation is tested.
    """
    every, table, measured, lost = innovations
    estimates, sigmas, health = told
    pwm, command = voltage
    for i in range(len(table)):
        row = table[i]
        for k in range(len(channels)):
            sigma = row[2 * every + channels[k]]
            estimates[i, k] = row[channels[k]]
            sigmas[i, k] = math.nan if sigma == 0.0 else sigma
        health[i, 0], health[i, 1] = row[-1], row[-2] / max(measured[i], 1)
        health[i, 2] = lost[i] and not frozen
        sign = math.copysign(1.0, row[3 * every + SPEED])
        testable = pwm or (command >= 0 and not math.isnan(rows[i, command]))
        for k in range(len(TESTED)):
            sigma, found = row[2 * every + TESTED[k]], math.nan
            if testable and not frozen and sigma > 0.0:
                found = row[every + TESTED[k]] / sigma
            values[i, FIRST + 2 * k] = found
            values[i, FIRST + 2 * k + 1] = found * sign


@lru_cache(maxsize=8)
def output_of(tested: tuple[int, ...], first: int) -> Callable[..., None]:
    """``output_loops``, compiled; ``first`` is the column of the first innovation."""
    loop = backends.bound(output_loops, TESTED=tested, FIRST=first)
    made: Callable[..., None] = backends.exact(loop)
    return made
