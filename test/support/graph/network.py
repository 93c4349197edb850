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

"""What carries messages between the nodes of a simulated graph, as DDS does.

Each writer numbers its messages. Of one writer they arrive in order, after a delay that is drawn;
of several in any order. A reader keeps its last ``depth`` messages while its node is busy. A late
reader of a latched topic is sent the last message of each writer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rclpy.qos import DurabilityPolicy

from support.graph.scheduler import Scheduler

NUMBER = "publication_sequence_number"
DELAY_NS = (100_000, 3_000_000)
"""Of a message on its way."""
FOUND_NS = (1_000_000, 300_000_000)
"""Until reader and writer know each other."""


@dataclass(eq=False)
class Writer:
    """One publisher."""

    network: Network
    node: Any
    topic: str
    qos_profile: Any
    sent: int = 0
    last: tuple[Any, int] | None = None
    readers: dict[Reader, int] = field(default_factory=dict)
    """Those that it knows, each with the time at which its last message arrives."""

    @property
    def latched(self) -> bool:
        """Whether late readers are sent the last message."""
        return bool(self.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)

    def publish(self, message: Any) -> None:
        """Send a message to all readers that are known."""
        self.sent += 1
        self.last = message, self.sent
        self.network.heard(self, message)
        for reader in self.readers:
            self.network.carry(self, reader, message, self.sent)

    def get_subscription_count(self) -> int:
        """Readers that are known."""
        return len(self.readers)

    def wait_for_all_acked(self, _limit: Any) -> bool:
        """Readers that are known have what was sent, or will have it in its order."""
        return True


@dataclass(eq=False)
class Reader:
    """One subscription."""

    node: Any
    topic: str
    callback: Callable[..., None]
    qos_profile: Any
    waiting: deque[tuple[Any, int]]
    writers: int = 0

    def get_publisher_count(self) -> int:
        """Writers that are known."""
        return self.writers

    def serve(self) -> None:
        """Hand on the oldest message, unless it had to make room."""
        if self.waiting:
            message, number = self.waiting.popleft()
            self.node.network.took(self, message)
            self.callback(message, {NUMBER: number})


class Network:
    """All writers and readers of a graph.

    Parameters
    ----------
    scheduler : clock and order
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler
        self.nodes: list[Any] = []
        self.writers: list[Writer] = []
        self.readers: list[Reader] = []
        self.loses: Callable[[Writer, Reader], bool] = lambda writer, reader: False
        """Whether a message does not arrive."""
        self.delay_ns: Callable[[Writer], int] = lambda writer: self._drawn(DELAY_NS)
        self.heard: Callable[[Writer, Any], None] = lambda writer, message: None
        """Told of all that is published."""
        self.took: Callable[[Reader, Any], None] = lambda reader, message: None
        """Told of all that is handed to a node."""

    def _drawn(self, limits: tuple[int, int]) -> int:
        return self.scheduler.random.randint(*limits)

    def carry(self, writer: Writer, reader: Reader, message: Any, number: int) -> None:
        """Have a message arrive, later than the one before."""
        if self.loses(writer, reader):
            return
        arrives_ns = self.scheduler.now_ns + self.delay_ns(writer)
        arrives_ns = max(arrives_ns, writer.readers[reader] + 1)
        writer.readers[reader] = arrives_ns

        def arrive() -> None:
            if reader in self.readers:
                reader.waiting.append((message, number))
                reader.node.serve_soon(reader.serve)

        self.scheduler.at(arrives_ns, arrive)

    def add_writer(self, writer: Writer) -> Writer:
        """Make a writer known to the readers of its topic, after a while."""
        self.writers.append(writer)
        for reader in self.readers:
            self._introduce(writer, reader)
        return writer

    def add_reader(self, reader: Reader) -> Reader:
        """Make a reader known to the writers of its topic, after a while."""
        self.readers.append(reader)
        for writer in self.writers:
            self._introduce(writer, reader)
        return reader

    def _introduce(self, writer: Writer, reader: Reader) -> None:
        if writer.topic != reader.topic:
            return

        def found() -> None:
            if writer not in self.writers or reader not in self.readers:
                return
            reader.writers += 1
            writer.readers[reader] = 0
            if writer.latched and writer.last is not None:
                self.carry(writer, reader, *writer.last)

        self.scheduler.at(self.scheduler.now_ns + self._drawn(FOUND_NS), found)

    def remove_writer(self, writer: Writer) -> None:
        """A publisher is destroyed; what is on its way arrives."""
        self.writers.remove(writer)
        for reader in writer.readers:
            reader.writers -= 1

    def remove_reader(self, reader: Reader) -> None:
        """A subscription is destroyed; what is on its way to it is not taken."""
        self.readers.remove(reader)
        for writer in self.writers:
            writer.readers.pop(reader, None)
