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

"""Puts records of several topics into one order, the same live and in replay.

Topics arrive each in its own order, but not in order among each other. Records wait until a
clock record (the residual of a scan) has passed their stamp by ``watermark_ns``; then they
leave by (stamp, topic rank, arrival). What comes later than that is late: counted and passed
over. ``hold`` stops the release at a stamp until an answer that belongs there has come. Where
everything of a scan has come before the next one (``in_step``), nothing waits for longer.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np

from flea_diag.core.invariant import ordered
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import ChannelTable, DataQuality, Detection, Record, Remark, Symbols
from flea_diag.wire.topics import TOPIC_OF

STANDING = (ChannelTable, DataQuality, Detection, Symbols, Remark)
"""Latched records: a node that starts later gets them late, and needs them all the same."""
RESTART_NS = 1_000_000_000
"""A clock that jumps back by more than this has started a new run."""
IN_STEP_NS = 1
"""What is older than the clock is due."""


class Merge:
    """Buffer between several topics and one stage; bounded by the watermark."""

    def __init__(self, clock: type, watermark_ns: int, hold_limit_ns: int) -> None:
        self._clock = clock
        self._clock_rank = TOPIC_OF[clock].rank
        self._watermark_ns = self._wait_ns = watermark_ns
        self._hold_limit_ns = hold_limit_ns
        self._waiting: list[tuple[int, int, int, Record | ResidualBlock]] = []
        self._others = 0
        """How many of those that wait are no clock records."""
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
                self.in_step(False)  # they are not
                return
            stamp = self._released_ns
        self._arrivals += 1
        entry = (stamp, TOPIC_OF[type(record)].rank, self._arrivals, record)
        heapq.heappush(self._waiting, entry)
        if type(record) is self._clock:
            self.now_ns = max(self.now_ns, stamp)
        else:
            self._others += 1

    def push_block(self, block: ResidualBlock) -> None:
        """Take in clock records in order, none of them older than what has been released.

        A block that still waits goes on in this one, of the same stream: what is left of the last
        one would have a turn of its own.
        """
        if len(self._waiting) == 1 and isinstance(before := self._waiting[0][-1], ResidualBlock):
            self._waiting.clear()
            block = ResidualBlock.joined((before, block))
        self._wait_again(block)
        self.now_ns = int(block.stamps_ns[-1])

    def _wait_again(self, block: ResidualBlock) -> None:
        self._arrivals += 1
        entry = (int(block.stamps_ns[0]), self._clock_rank, self._arrivals, block)
        heapq.heappush(self._waiting, entry)

    @property
    def clock_alone(self) -> bool:
        """Whether nothing but clock records waits."""
        return not self._others

    def _restart(self) -> None:
        """The clock has jumped back: a new run, to which nothing that waits belongs."""
        self.late += len(self._waiting)
        self._waiting.clear()
        self._others = 0
        self.now_ns = self._released_ns = -1
        self._hold_ns = None

    def in_step(self, in_step: bool) -> None:
        """Whether all records of a scan come before the clock record of the next one."""
        self._wait_ns = IN_STEP_NS if in_step else self._watermark_ns

    def hold(self, stamp_ns: int | None) -> None:
        """Release nothing after ``stamp_ns`` until told otherwise, or the limit has passed."""
        self._hold_ns = stamp_ns

    def pop(
        self, everything: bool = False, in_blocks: Callable[[], bool] = bool
    ) -> Record | ResidualBlock | None:
        """The next record in order, or None when none is due; ``everything`` ends the stream.

        Where they may leave ``in_blocks``, of a block all that is due before anything else.
        """
        if not self._waiting:
            return None
        stamp = self._waiting[0][0]
        if not everything and stamp > self._due_ns():
            return None
        ordered("merge", self._released_ns, stamp)
        self._released_ns = stamp
        _, rank, _, record = heapq.heappop(self._waiting)
        if not isinstance(record, ResidualBlock):
            self._others -= rank != self._clock_rank
            return record
        single = not in_blocks()
        count = 1 if single else self._leading(record, everything)
        if count < len(record):
            self._wait_again(record.part(slice(count, None)))
        self._released_ns = int(record.stamps_ns[count - 1])
        return next(record.part(slice(1)).records()) if single else record.part(slice(count))

    def _leading(self, block: ResidualBlock, everything: bool) -> int:
        """How many records of this block are due before whatever else waits; at least one."""
        count = len(block)
        if not everything:
            count = int(np.searchsorted(block.stamps_ns, self._due_ns(), "right"))
        if self._waiting:
            stamp_ns, rank, _, _ = self._waiting[0]
            before = stamp_ns + (rank > self._clock_rank)
            count = min(count, int(np.searchsorted(block.stamps_ns, before)))
        return max(count, 1)

    def _due_ns(self) -> int:
        due = self.now_ns - self._wait_ns
        if self._hold_ns is None or due > self._hold_ns + self._hold_limit_ns:
            return due
        return min(due, self._hold_ns)
