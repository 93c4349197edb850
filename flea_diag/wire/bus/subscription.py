"""The receiving path: one subscription, what it passes on, and what it counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from flea_diag.errors import InputError, WireError
from flea_diag.wire.bus.life_cycle import ACTIVE
from flea_diag.wire.bus.lost_messages import LostMessages, numbered
from flea_diag.wire.topics import Topic


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
    the first.
    """

    topic: Topic
    node: ReceivingNode = field(repr=False)
    received: int = 0
    malformed: int = 0
    malformed_ns: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    lost: int = 0

    def receiver(
        self, take: Callable[[bytes], None], writers: Callable[[], int]
    ) -> Callable[..., None]:
        """Callback of a raw subscription: passes messages to ``take`` while the node is active.

        ``writers`` returns the present number of writers.
        """
        node, missing = self.node, LostMessages(writers)

        def received(data: bytes, number: int | None) -> None:
            # A hundred times a second: every further call is paid for with cold caches.
            try:
                lost = missing.before(number)
                if node.state != ACTIVE:
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

    def _lose(self, lost: int) -> None:
        self.lost += lost
        self.node.warn(
            f"{self.topic.name}: {self.lost} messages lost: subscriber or network too slow"
        )
