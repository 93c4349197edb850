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

"""Speed and motion of a recording from its positions, insensitive to noise of single readings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Scan

Array = npt.NDArray[np.float64]

POSITION = "actuator_position"
MOVING_M_S = 0.010
SPAN = 10
"""Scans on either side used for a speed."""


def speed(times_s: Array, position_m: Array) -> Array:
    """Speed (m/s) at each scan, shape (n,); NaN within ``SPAN`` of either end."""
    found = np.full(len(position_m), np.nan)
    if len(position_m) > 2 * SPAN:
        way = position_m[2 * SPAN :] - position_m[: -2 * SPAN]
        found[SPAN:-SPAN] = way / (times_s[2 * SPAN :] - times_s[: -2 * SPAN])
    return found


def moving_s(records: Iterable[Any], from_ns: int, to_ns: int) -> float:
    """Seconds in motion between two stamps, from the Scan and ScanBlock among the records.

    Used for delays in motion, since a fault cannot be detected at rest.
    """
    stamps: list[int] = []
    positions: list[float] = []
    for record in records:
        if isinstance(record, Scan):
            stamps.append(record.stamp_ns)
            positions.append(record.value(POSITION))
        elif isinstance(record, ScanBlock) and POSITION in record.channels:
            stamps += record.stamps_ns.tolist()
            positions += record.values[:, record.channels.index(POSITION)].tolist()
    if len(stamps) <= 2 * SPAN:
        return 0.0
    stamps_ns = np.array(stamps)
    time_s = (stamps_ns - stamps[0]) / 1e9
    moving = np.abs(speed(time_s, np.array(positions))) > MOVING_M_S
    inside = (stamps_ns >= from_ns) & (stamps_ns < to_ns)
    return float(np.sum(np.gradient(time_s)[moving & inside]))
