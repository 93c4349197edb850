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

"""Messages of an MCAP file, and those that wait for their turn where chunks overlap in time."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from heapq import heappop, heappush
from operator import attrgetter
from typing import NamedTuple

from flea_diag.wire.bags.budget import Budget

_log_ns, _data = attrgetter("log_ns"), attrgetter("data")


class Schema(NamedTuple):
    """Name, encoding and text of a message definition."""

    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    """Topic, message type and encoding of a channel."""

    topic: str
    message: str
    encoding: str
    schema: Schema = Schema("", "", b"")
    metadata: tuple[tuple[str, str], ...] = ()


class McapMessage(NamedTuple):
    """One message as stored in the file."""

    log_ns: int
    publish_ns: int
    channel: Channel
    data: bytes


def extent(messages: list[McapMessage]) -> tuple[int, int]:
    """Bytes of data, and number."""
    return sum(map(len, map(_data, messages))), len(messages)


class Waiting:
    """Messages of several pieces, merged by log time; equal times keep the order of the pieces.

    Each message is sorted once, in its piece, however many pieces overlap.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._pieces: list[list[McapMessage]] = []
        self._heap: list[tuple[int, int, int]] = []
        """Next log time, number and place of each piece that has messages left."""

    def hold(self, messages: list[McapMessage]) -> None:
        """Charge messages that are going to be added."""
        self._budget.hold(*extent(messages))

    def add(self, messages: list[McapMessage]) -> None:
        """Add the messages of the next piece, which are held."""
        if messages:
            messages.sort(key=_log_ns)
            heappush(self._heap, (messages[0].log_ns, len(self._pieces), 0))
            self._pieces.append(messages)

    def before(self, end_ns: int | None) -> Iterator[list[McapMessage]]:
        """Messages in order that are older than a time, all if there is none; they wait no more.

        Those that come from one piece after each other are together.
        """
        while self._heap and (end_ns is None or self._heap[0][0] < end_ns):
            _, number, start = heappop(self._heap)
            messages = self._pieces[number]
            end = self._end(messages, number, start, end_ns)
            due = messages[start:end]
            self._budget.release(*extent(due))
            yield due
            if end < len(messages):
                heappush(self._heap, (messages[end].log_ns, number, end))
            else:
                self._pieces[number] = []

    def _end(self, messages: list[McapMessage], number: int, start: int, end_ns: int | None) -> int:
        """Place up to which the messages of a piece come before those of all others."""
        end = len(messages)
        if end_ns is not None and messages[-1].log_ns >= end_ns:
            end = bisect_left(messages, end_ns, start, key=_log_ns)
        if self._heap and messages[end - 1].log_ns >= self._heap[0][0]:
            other_ns, other, _ = self._heap[0]
            of = bisect_right if number < other else bisect_left
            end = of(messages, other_ns, start, end, key=_log_ns)
        return end
