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

"""Nodes that a source streams to: ready before its first record, done after its last one.

The one notion of readiness: a node is ready when its life cycle says ``active``. The simulated
stand, the player of bags and the live run all wait for it here.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from flea_diag.errors import ConfigurationError
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.records import AmbiguityGroup

TOLD_EVERY_S = 5.0
SETTLE_S = 0.3
"""Time for which the connections must not change. A node that says that it is active has all of
its subscriptions, but these may be discovered after the message that says so."""
ACKNOWLEDGED_S = 2.0
"""Longest wait for readers to acknowledge the first message; one of them may be dying."""
LAST_VERDICT_S = 5.0
"""Longest wait for the verdict on the last record."""


def named(text: str) -> tuple[str, ...]:
    """Names of a list such as ``observer,isolator``."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


class Consumers:
    """The named nodes, from their start to their last verdict.

    Parameters
    ----------
    bus
        Bus of the source.
    names
        Nodes to wait for, relative to the namespace.
    limit_s
        Longest wait until all are active.
    streams
        Record types that the source publishes; every subscriber found must be connected.
    """

    def __init__(
        self, bus: Bus[Any], names: Iterable[str], limit_s: float, streams: tuple[type, ...] = ()
    ) -> None:
        self._bus, self._limit_s, self._streams = bus, limit_s, streams
        self._names = frozenset(names)
        self._states = bus.node_states(self._names)
        self._begin_s = self._told_s = time.monotonic()
        self._settled_s: float | None = None
        self._told_first_s: float | None = None
        self._ended_s: float | None = None
        self._verdict_is_last = False

    def ready(self) -> bool:
        """Whether all are active and connected; logs from time to time who is missing.

        Raises
        ------
        ConfigurationError
            Not within the limit.
        """
        now_s = time.monotonic()
        missing = self._missing()
        if not missing:
            self._settled_s = self._settled_s or now_s
            return not self._names or now_s - self._settled_s >= SETTLE_S
        self._settled_s = None
        waited_s = now_s - self._begin_s
        who = ", ".join(f"{name} ({state})" for name, state in sorted(missing.items()))
        if waited_s > self._limit_s:
            raise ConfigurationError(
                f"not ready after {self._limit_s:g} s: {who}; start it, or wait longer (wait_s)"
            )
        if now_s - self._told_s > TOLD_EVERY_S:
            self._told_s = now_s
            limit = f"{waited_s:.0f} s of at most {self._limit_s:.0f} s"
            self._bus.info(f"waiting for {who} to become active, {limit}")
        return False

    def acknowledged(self, record_type: type) -> bool:
        """After the first message: whether every reader has it, or is waited for no longer.

        Who has acknowledged it will get what follows on the other topics, too.
        """
        now_s = time.monotonic()
        self._told_first_s = self._told_first_s or now_s
        waited_s = now_s - self._told_first_s
        return self._bus.publishers.acknowledged(record_type) or waited_s > ACKNOWLEDGED_S

    def done(self) -> bool:
        """After the last record: whether the verdict on it has come, or will not come any more."""
        now_s = time.monotonic()
        if self._ended_s is None:
            self._ended_s = now_s
            if self._names:  # only now: a verdict is large, and this source keeps a pace
                self._bus.subscribe(AmbiguityGroup, self._note)
        return not self._names or self._verdict_is_last or now_s - self._ended_s > LAST_VERDICT_S

    def _missing(self) -> dict[str, str]:
        missing = self._states.not_active()
        if missing or not self._streams:
            return missing
        heard = set().union(*(self._bus.publishers.listeners(kind) for kind in self._streams))
        unheard = dict.fromkeys(self._names - heard, "not connected")
        if all(self._bus.publishers.connected(kind) for kind in self._streams):
            return unheard
        return unheard or dict.fromkeys(self._names, "connecting")

    def _note(self, group: AmbiguityGroup) -> None:
        """A stale verdict says that its node has heard the source stop."""
        self._verdict_is_last = group.stale
