"""Puts records of several topics into one order, the same live and in replay.

Topics arrive each in its own order, but not in order among each other. Records wait until a
clock record (the residual of a scan) has passed their stamp by ``watermark_ns``; then they
leave by (stamp, topic rank, arrival). What comes later than that is late: counted and passed
over. ``hold`` stops the release at a stamp until an answer that belongs there has come.
"""

from __future__ import annotations

import heapq

from flea_diag.wire.records import ChannelTable, DataQuality, Detection, Record, Symbols
from flea_diag.wire.topics import TOPIC_OF

STANDING = (ChannelTable, DataQuality, Detection, Symbols)
"""Latched records: a node that starts later gets them late, and needs them all the same."""
RESTART_NS = 1_000_000_000
"""A clock that jumps back by more than this has started a new run."""


class Merge:
    """Buffer between several topics and one stage; bounded by the watermark."""

    def __init__(self, clock: type, watermark_ns: int, hold_limit_ns: int) -> None:
        self._clock = clock
        self._watermark_ns = watermark_ns
        self._hold_limit_ns = hold_limit_ns
        self._waiting: list[tuple[int, int, int, Record]] = []
        self._arrivals = 0
        self.now_ns = -1
        self._released_ns = -1
        self._hold_ns: int | None = None
        self.late = 0

    def push(self, record: Record) -> None:
        """Take a record in."""
        stamp = record.stamp_ns
        if type(record) is self._clock and stamp < self.now_ns - RESTART_NS:
            self._restart()
        if stamp < self._released_ns:
            # What tells how things stand is as old as it likes to be, and never too late.
            if not isinstance(record, STANDING):
                self.late += 1
                return
            stamp = self._released_ns
        self._arrivals += 1
        entry = (stamp, TOPIC_OF[type(record)].rank, self._arrivals, record)
        heapq.heappush(self._waiting, entry)
        if type(record) is self._clock:
            self.now_ns = max(self.now_ns, stamp)

    def _restart(self) -> None:
        """The clock has jumped back: a new run, to which nothing that waits belongs."""
        self.late += len(self._waiting)
        self._waiting.clear()
        self.now_ns = self._released_ns = -1
        self._hold_ns = None

    def hold(self, stamp_ns: int | None) -> None:
        """Release nothing after ``stamp_ns`` until told otherwise, or the limit has passed."""
        self._hold_ns = stamp_ns

    def pop(self, everything: bool = False) -> Record | None:
        """The next record in order, or None when none is due; ``everything`` ends the stream."""
        if not self._waiting:
            return None
        stamp = self._waiting[0][0]
        if not everything and stamp > self._due_ns():
            return None
        self._released_ns = max(self._released_ns, stamp)
        return heapq.heappop(self._waiting)[3]

    def _due_ns(self) -> int:
        due = self.now_ns - self._watermark_ns
        if self._hold_ns is None or due > self._hold_ns + self._hold_limit_ns:
            return due
        return min(due, self._hold_ns)
