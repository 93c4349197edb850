"""Whether scans come in order and without a gap: what was late, twice or lost is counted."""

from __future__ import annotations

from enum import Enum

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import ChannelQuality, Quality

Stamps = npt.NDArray[np.int64]

STREAM = "sensors/slow"
RESTART_NS = 1_000_000_000
"""A stamp that is older than the stream by more than this starts a new one."""


class Place(Enum):
    """How a scan follows on the one before."""

    NEXT = "next"
    AFTER_GAP = "after a gap"
    RESTART = "of a new stream"
    PASSED_OVER = "late, or here already"


class StreamOrder:
    """Stamps of one stream of scans, with what was counted on it over all its restarts."""

    def __init__(self, period_ns: int, gap_scans: int) -> None:
        self._period_ns = period_ns
        self._gap_scans = gap_scans
        self._counters = dict.fromkeys(("samples", "late", "duplicate", "lost"), 0)
        self.first_ns: int | None = None
        self.last_ns: int | None = None

    def step(self, stamp_ns: int) -> Place:
        """Take one scan."""
        self._counters["samples"] += 1
        if self.last_ns is None:
            self.first_ns = self.last_ns = stamp_ns
            return Place.RESTART
        ahead_ns = stamp_ns - self.last_ns
        if ahead_ns == 0:
            self._counters["duplicate"] += 1
            return Place.PASSED_OVER
        if ahead_ns < 0:
            self._counters["late"] += 1
            if ahead_ns >= -RESTART_NS:
                return Place.PASSED_OVER
            self.first_ns = self.last_ns = stamp_ns
            return Place.RESTART
        missing = round(ahead_ns / self._period_ns) - 1
        self._counters["lost"] += max(missing, 0)
        self.last_ns = stamp_ns
        return Place.AFTER_GAP if missing >= self._gap_scans else Place.NEXT

    def leading(self, stamps_ns: Stamps) -> int:
        """How many of these scans follow on one another, and on the stream, with none lost."""
        if self.last_ns is None:
            return 0
        ahead_ns, missing = self._ahead(stamps_ns)
        wrong = np.flatnonzero((ahead_ns <= 0) | (missing >= 1))
        return int(wrong[0]) if len(wrong) else len(stamps_ns)

    def follow(self, stamps_ns: Stamps) -> None:
        """Take scans that ``leading`` has found to be in order."""
        _, missing = self._ahead(stamps_ns)
        self._counters["samples"] += len(stamps_ns)
        self._counters["lost"] += int(np.maximum(missing, 0.0).sum())
        self.last_ns = int(stamps_ns[-1])

    def _ahead(self, stamps_ns: Stamps) -> tuple[Stamps, npt.NDArray[np.float64]]:
        """How far each scan is after the one before, and how many are missing between them."""
        ahead_ns = stamps_ns - np.append(self.last_ns or 0, stamps_ns[:-1])
        return ahead_ns, np.rint(ahead_ns / self._period_ns) - 1.0

    def state(self) -> ChannelQuality:
        """The stream as a row of DataQuality."""
        counted = tuple(self._counters.items())
        return ChannelQuality(STREAM, Quality.GOOD, self.first_ns or 0, "", counted)
