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

"""Joins a nominal and a faulty recording into one run, without informing the diagnoser.

This is the central experiment of the paper: control is switched from the healthy to the faulty
actuator. The join is where both move in the same direction through the same position at nearly
the same speed. All readings are kept, including the temperatures and offsets of the other unit;
stamps continue by one period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.tools.motion import POSITION, SPAN, speed
from flea_diag.wire.records import ChannelTable, Record, Scan, Truth

Array = npt.NDArray[np.float64]

SPEED_WEIGHT_S = 0.05
"""Time by which a difference in speed is converted to a distance."""
LARGEST_STEP_M = 1e-3
"""Largest step of the position at a join."""
LATEST_SHARE = 0.5
"""Part of the faulty run in which it may be joined, so that enough of it remains."""


@dataclass(frozen=True)
class Join:
    """Last scan used of the nominal run, first scan used of the faulty run."""

    last: int
    first: int


def splice(
    nominal: Sequence[Record], faulty: Sequence[Record], margin_s: float
) -> tuple[Record, ...]:
    """Records of the joined run: channel table, the faulty run's truth from the join on, scans.

    Parameters
    ----------
    nominal, faulty
        Records of two runs; only ChannelTable, Truth and Scan are used.
    margin_s
        Time of the nominal run before which there is no join.

    Raises
    ------
    RecordingError
        A run has no scans, or the runs have no matching point.
    """
    before, after = _scans(nominal), _scans(faulty)
    join = find_join(before, after, margin_s)
    period_ns = int(np.median(np.diff([scan.stamp_ns for scan in before])))
    onset_ns = before[join.last].stamp_ns + period_ns
    shift_ns = onset_ns - after[join.first].stamp_ns
    table = next(record for record in nominal if isinstance(record, ChannelTable))
    truths = [record for record in faulty if isinstance(record, Truth)]
    truth = next((record for record in truths if record.fault != "nominal"), None)
    moved = [replace(s, stamp_ns=s.stamp_ns + shift_ns) for s in after[join.first :]]
    told = [] if truth is None else [replace(truth, stamp_ns=onset_ns, onset_ns=onset_ns)]
    return (table, *before[: join.last + 1], *told, *moved)


def _scans(records: Sequence[Record]) -> list[Scan]:
    scans = [record for record in records if isinstance(record, Scan)]
    if len(scans) <= 4 * SPAN:
        raise RecordingError(f"{len(scans)} scans: too few for a join")
    return scans


def find_join(before: Sequence[Scan], after: Sequence[Scan], margin_s: float) -> Join:
    """Join with the smallest step of position and speed (weighted by a short time).

    Raises
    ------
    RecordingError
        The runs never pass the same position in the same direction.
    """
    x, v = _motion(before)
    y, w = _motion(after)
    start = int(np.searchsorted(_times(before), margin_s))
    rows = np.arange(max(start, SPAN), len(x) - SPAN)
    columns = np.arange(SPAN, max(SPAN + 1, int(LATEST_SHARE * len(y))))
    step = np.abs(x[rows, None] - y[columns])
    cost = step + SPEED_WEIGHT_S * np.abs(v[rows, None] - w[columns])
    cost[(np.sign(v[rows, None]) != np.sign(w[columns])) | (step > LARGEST_STEP_M)] = np.inf
    cost[~np.isfinite(cost)] = np.inf
    if not cost.size or not np.isfinite(cost).any():
        raise RecordingError(
            f"the two runs never pass within {1e3 * LARGEST_STEP_M:g} mm of each other in the same "
            "direction: they cannot be joined"
        )
    row, column = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return Join(int(rows[row]), int(columns[column]))


def _times(scans: Sequence[Scan]) -> Array:
    return np.array([(scan.stamp_ns - scans[0].stamp_ns) / 1e9 for scan in scans])


def _motion(scans: Sequence[Scan]) -> tuple[Array, Array]:
    """Position (m) and its speed (m/s) over a short span, shape (n,) each."""
    position = np.array([scan.value(POSITION) for scan in scans])
    return position, speed(_times(scans), position)
