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

"""Whether a position reading got where it is by moving: a sensor that died there did not.

A reading at the end of its range looks like an end of travel. It is believed if no two readings
before it are further apart than the end is wide, and if it went as far as the motor turned. Once
doubted it stays so until it has left the ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LOOKS_BACK_S = 0.64
"""Time over which a reading is held against itself and against the motor's speed."""
SLIP = 0.05
"""Share of a way by which two sensors of it may differ."""


def arrived(readings: Array, speeds: Array, period_s: float, width: float) -> bool:
    """Whether the last reading was reached by moving.

    Parameters
    ----------
    readings : shape (n,)
        Oldest first, NaN where missing; the last is finite.
    speeds : shape (n,)
        By another sensor, in units of the readings per second; NaN where unknown.
    width
        Of an end, in units of the readings.
    """
    known = np.flatnonzero(np.isfinite(readings))
    values = readings[known]
    if len(values) > 1 and np.abs(np.diff(values)).max() > width:
        return False
    turned = speeds[known[0] + 1 :]
    if not len(turned) or np.isnan(turned).any():
        return True
    way = float(values[-1] - values[0])
    apart = abs(way - float(turned.sum()) * period_s)
    return apart <= width + SLIP * abs(way)


def still(readings: Sequence[Array], width: float) -> bool:
    """Whether every reading, each of shape (n,), stays within this width; False if none is known.

    Readings of a sensor with noise must be given over few scans.
    """
    spans = [column[np.isfinite(column)] for column in readings]
    return any(len(s) > 1 for s in spans) and all(np.ptp(s) <= width for s in spans if len(s) > 1)
