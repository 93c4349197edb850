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

"""The receiving path: one subscription, what it passes on, and what it counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from flea_diag.errors import InputError, WireError
from flea_diag.wire.bus.life_cycle import ACTIVE
from flea_diag.wire.bus.numbered.lost_messages import LostMessages, numbered
from flea_diag.wire.bus.numbered.one_source import OneSource
from flea_diag.wire.records import Scan, VibrationBlock
from flea_diag.wire.topics import Topic

ASK_EVERY = 100
"""Messages of a second source from one look at the graph to the next."""
OF_ONE_SOURCE: tuple[type, ...] = (Scan, VibrationBlock)
"""Streams of which two would read as one with a fault."""


class ReceivingNode(Protocol):
    """What a subscription needs of its node."""

    state: str
    """State of the life cycle."""
    on_failure: Callable[[Exception], None] | None
    """Takes what ``take`` raises; without it the program ends."""

    def now_ns(self) -> int:
        """Clock of the node."""
        ...

    def warn(self, text: str) -> None:
        """Log a warning, throttled."""
        ...


@dataclass
class Subscription:
    """Counters of one subscription: messages received, and messages skipped by reason.

    ``kinds`` counts the malformed ones by the kind of their error, ``malformed_ns`` is the time of
    the first. ``foreign`` counts messages of a second source, ``sources`` are the nodes that
    publish.
    """

    topic: Topic
    node: ReceivingNode = field(repr=False)
    received: int = 0
    malformed: int = 0
    malformed_ns: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    lost: int = 0
    foreign: int = 0
    sources: tuple[str, ...] = ()
    _kept: tuple[bytes, Callable[[bytes], None]] | None = field(default=None, repr=False)

    def receiver(
        self,
        take: Callable[[bytes], None],
        writers: Callable[[], int],
        sources: Callable[[], tuple[str, ...]] = tuple,
    ) -> Callable[..., None]:
        """Callback of a raw subscription: passes messages to ``take`` while the node is active.

        ``writers`` returns the present number of writers, ``sources`` the nodes that they are of.
        """
        node, missing = self.node, LostMessages(writers)
        gate = OneSource(writers) if self.topic.record in OF_ONE_SOURCE else None

        def received(data: bytes, number: int | None) -> None:
            # A hundred times a second: every further call is paid for with cold caches.
            try:
                if gate is not None and not gate.admits(number, data):
                    self._leave(sources)
                    return
                lost = missing.before(number)
                if node.state != ACTIVE:
                    if self.topic.latched:
                        self._kept = data, take
                    return
                if lost:
                    self._lose(lost)
                self.received += 1
                take(data)
            except (WireError, InputError) as error:
                self._skip(error)
            except Exception as error:
                if node.on_failure is None:
                    raise
                node.on_failure(error)

        return numbered(received)

    def hand_over(self) -> None:
        """Pass on the last message of a latched topic that came while the node was not active.

        Nobody sends it again: it says how things stand.
        """
        if self._kept is None:
            return
        (data, take), self._kept = self._kept, None
        self.received += 1
        try:
            with self.counted():
                take(data)
        except Exception as error:
            if self.node.on_failure is None:
                raise
            self.node.on_failure(error)

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count and pass over a message that is malformed, or whose record is refused."""
        try:
            yield
        except (WireError, InputError) as error:
            self._skip(error)

    def _skip(self, error: WireError | InputError) -> None:
        if isinstance(error, WireError):
            self.malformed += 1
            self.kinds[error.kind] += 1
            self.malformed_ns = self.malformed_ns or self.node.now_ns()
            self.node.warn(f"{self.topic.name}: message skipped: {error}")
        else:
            self.refused += 1
            self.node.warn(f"{self.topic.name}: record skipped: {error}")

    def _leave(self, sources: Callable[[], tuple[str, ...]]) -> None:
        """Count a message of a second source; whose they are is asked now and then."""
        if self.foreign % ASK_EVERY == 0 or len(self.sources) < 2:
            self.sources = sources()
        self.foreign += 1
        self.node.warn(
            f"{self.topic.name}: {self.words_on_sources}; end one, or give it another namespace"
        )

    @property
    def words_on_sources(self) -> str:
        """That there is a second source, and who publishes."""
        names = ", ".join(self.sources) or "unknown nodes"
        return (
            f"published by {names}: the first is used as long as it delivers, {self.foreign} "
            "messages of another are not"
        )

    def _lose(self, lost: int) -> None:
        self.lost += lost
        self.node.warn(
            f"{self.topic.name}: {self.lost} messages lost: subscriber or network too slow"
        )
