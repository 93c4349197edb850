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

"""Messages that wait for their turn: in blocks (``batch_ms``), or beside those of other stands.

Taking a message costs microseconds, judging it a hundred times that. A stand that sends too much
therefore fills its own inbox, and takes no more than its turns from the others in its process: a
turn and an inbox hold a number of messages and of bytes.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Any

from flea_diag.errors import WireError
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.bus import Bus
from flea_diag.wire.command_budget import MEGABYTE
from flea_diag.wire.messages.codec import decode
from flea_diag.wire.records import Record, Scan
from flea_diag.wire.topics import TOPIC_OF

TURN = 64
"""Messages of one turn, at most: some 5 ms. A stand with more scans waiting than its share takes
them as one block, each for a fraction of what it costs alone: so a process that is behind catches
up instead of falling back further."""
TURN_BYTES = 100_000
"""Bytes after which a turn takes no further message: large ones take longer."""
MOST_WAITING = 300
"""Messages of one topic that may wait, where its own queue is not longer: 3 s at 100 Hz. When many
stands begin or jam at once, the last of them waits for a second or two."""
MOST_BYTES = 16_000_000
"""Of one stand that may wait together: 5 s of six axes at 100 kHz."""


class Turns:
    """Gives each inbox that asks a short turn, in the order of asking.

    Parameters
    ----------
    bus
        Of the node that owns the executor.
    batch_ms
        Period of the rounds; 0: a round begins as soon as an inbox asks.
    """

    def __init__(self, bus: Bus[Any], batch_ms: float = 0.0) -> None:
        self._bus, self._batch_ms = bus, batch_ms
        self._asked: deque[Inbox] = deque()
        self._due: deque[Inbox] = deque()
        self._serving = False
        if batch_ms:
            bus.every(batch_ms / 1e3, self._begin)

    def ask(self, inbox: Inbox) -> None:
        """Note an inbox that is no longer empty."""
        self._asked.append(inbox)
        if not self._batch_ms:
            self._begin()

    def _begin(self) -> None:
        self._due.extend(self._asked)
        self._asked.clear()
        self._go_on()

    def _go_on(self) -> None:
        if self._due and not self._serving:
            self._serving = True
            self._bus.soon(self._serve)

    def _serve(self) -> None:
        """One turn; what arrived meanwhile at the others is taken off the wire before the next."""
        self._serving = False
        inbox = self._due.popleft()
        if inbox.turn():
            self._due.append(inbox)
        self._go_on()


class Inbox:
    """What has arrived for one stage, in order of arrival, undecoded.

    A topic whose messages wait in full number loses all of them: one long gap, where single scans
    lost time and again would have all others judged one by one, and what is judged is of now. A
    stand whose messages are too large for what it may have waiting loses those that come then. Both
    are counted. What waits is given back with each turn.

    Parameters
    ----------
    bus
        Of the stage's node.
    turns
        Asked when something waits.
    take
        Takes a record.
    take_block
        Takes consecutive scans at once; false if they must come one by one.
    """

    def __init__(
        self,
        bus: Bus[Any],
        turns: Turns,
        take: Callable[[Any], None],
        take_block: Callable[[ScanBlock], bool],
    ) -> None:
        self._bus, self._turns = bus, turns
        self._take, self._take_block = take, take_block
        self._waiting: deque[tuple[type, bytes]] = deque()
        self._counts: Counter[type] = Counter()
        self._bytes = 0
        """Of all that waits."""
        self._asked = False
        self._handle = bus.guarded(self._handle_some)
        bus.on("deactivate", self._clear)

    def subscribe(self, record_type: type[Record]) -> None:
        """Take the messages of a record's topic."""
        self._bus.subscribe_raw(record_type, partial(self._put, record_type))

    def _put(self, record_type: type, data: bytes) -> None:
        stream, topic = self._bus.streams[record_type], TOPIC_OF[record_type]
        if self._counts[record_type] >= (most := max(MOST_WAITING, topic.depth)):
            stream.lost += self._drop(record_type)
            self._bus.warn(f"{topic.name}: {most} messages waited and are lost: sent too fast")
        if self._bytes + len(data) > MOST_BYTES:
            stream.lost += 1
            self._bus.warn(
                f"{topic.name}: a message of {len(data) / MEGABYTE:.1f} MB is lost: with it more "
                f"than the {MOST_BYTES / MEGABYTE:.0f} MB of this stand would wait; send smaller "
                "ones, or fewer"
            )
            return
        self._counts[record_type] += 1
        self._bytes += len(data)
        self._waiting.append((record_type, data))
        if not self._asked:
            self._asked = True
            self._turns.ask(self)

    def _drop(self, record_type: type) -> int:
        """Let go of all that waits of a topic; how many they are."""
        kept = [each for each in self._waiting if each[0] is not record_type]
        dropped = len(self._waiting) - len(kept)
        self._clear()
        for kind, data in kept:
            self._counts[kind] += 1
            self._bytes += len(data)
        self._waiting.extend(kept)
        return dropped

    def turn(self) -> bool:
        """Handle what came first; whether more waits."""
        if not self._bus.working:
            self._clear()
        self._handle()
        self._asked = bool(self._waiting)
        return self._asked

    def _clear(self) -> None:
        self._waiting.clear()
        self._counts.clear()
        self._bytes = 0

    def _handle_some(self) -> None:
        scans: list[bytes] = []
        least_bytes = self._bytes - TURN_BYTES
        for _ in range(min(TURN, len(self._waiting))):
            if self._bytes <= least_bytes:
                break
            record_type, data = self._waiting.popleft()
            self._counts[record_type] -= 1
            self._bytes -= len(data)
            if record_type is Scan:
                scans.append(data)
                continue
            self._scans(scans)
            scans = []
            self._one(record_type, data)
        self._scans(scans)

    def _scans(self, messages: list[bytes]) -> None:
        block = _block(messages) if len(messages) > 1 else None
        if block is not None and self._take_block(block):
            return
        for data in messages:
            self._one(Scan, data)

    def _one(self, record_type: type, data: bytes) -> None:
        stream = self._bus.streams.get(record_type)
        if stream is not None and self._bus.working:
            with stream.counted():
                self._take(decode(record_type, data))


def _block(messages: list[bytes]) -> ScanBlock | None:
    """Scans in columns; None where they are read one by one, for instance to tell a bad one."""
    try:
        return scan_block(messages)
    except WireError:
        return None
