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

"""How the noise of a relation grows with the motion.

Sensors lag behind each other and no description is exact, so what a relation leaves is larger in a
fast motion, or under a large load, than at rest:

    variance = at rest + turning [reversal] + load F^2 + speed v^2 + acceleration a^2 + jerk j^2

where no part is negative (``MOTIONS``).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.run_windows import MOTIONS

Array = npt.NDArray[np.float64]

ANY_MOTION = (1.0, *(0.0 for _ in MOTIONS))
"""The same in every motion."""
AT_REST = 0.05
"""Least share of the variance at rest: what no healthy recording shows is not known that well."""
STEPS = 8
"""Of the fit: each weighs windows by the variance of the step before."""


def with_rest(motion: Array) -> Array:
    """Motions of windows, shape (..., ``MOTIONS``), behind a one."""
    return np.concatenate((np.ones((*motion.shape[:-1], 1)), motion), axis=-1)


def motion_variances(squares: Array, motion: Array, bound: float) -> Array:
    """Variance at rest and for one of each motion, shape (1 + ``MOTIONS``,).

    Least squares, each window in its variance as it is so far, beyond which no square counts for
    more than ``bound``.

    Parameters
    ----------
    squares
        Of what is left in white, shape (windows,).
    motion
        Of the same windows, shape (windows, ``MOTIONS``).
    """
    # A node that reads a calibration fits nothing, and would wait for the import.
    from scipy.optimize import nnls

    rows = with_rest(motion)
    usual = rows.mean(axis=0)
    usual[usual == 0.0] = 1.0
    rows = rows / usual
    variance = np.full(len(rows), max(float(squares.mean()), 1e-300))
    shares = np.ones(rows.shape[1])
    for _ in range(STEPS):
        bounded = np.minimum(squares / variance, bound)
        shares = nnls(rows / variance[:, None], bounded)[0]
        shares[0] = max(shares[0], AT_REST * float(shares.sum()), 1e-300)
        variance = rows @ shares
    return np.asarray(shares / usual)
