"""For how long of a stretch of a run the actuator moved: a fault that rests cannot be seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Scan

POSITION = "actuator_position"
MOVING_M_S = 0.010
SPAN = 10
"""Scans to either side over which a speed is taken: the noise of one reading is no motion."""


def moving_s(records: Iterable[Any], from_ns: int, to_ns: int) -> float:
    """Seconds in motion between two stamps, of the Scan and ScanBlock among some records."""
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
    time_s = (np.array(stamps) - stamps[0]) / 1e9
    x = np.array(positions)
    speed = (x[2 * SPAN :] - x[: -2 * SPAN]) / (time_s[2 * SPAN :] - time_s[: -2 * SPAN])
    inside = np.array(stamps)[SPAN:-SPAN]
    moving = (np.abs(speed) > MOVING_M_S) & (inside >= from_ns) & (inside < to_ns)
    return float(np.sum(np.gradient(time_s)[SPAN:-SPAN][moving]))
