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

"""The desks of several stands behind one screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from flea_diag.nodes.operator.desk import Desk, connect, open_journal
from flea_diag.operator.state import SHOWN, OperatorState
from flea_diag.wire.bus import Bus
from flea_diag.wire.bus.stand_bus import StandBus, namespaces
from flea_diag.wire.records import AmbiguityGroup, Health, Residual, Scan, VibrationLevel

ALL = "*"
"""In place of a namespace: every one in which there is a verdict."""
MOST_STANDS = 256
LOOK_S = 1.0
STREAMS: tuple[type, ...] = (Scan, Residual, VibrationLevel)
"""Records that are taken while a stand is open: they come at the rate of its scans."""
LISTED = tuple(kind for kind in SHOWN if kind not in (*STREAMS, Health))


class Hall:
    """Follows the verdicts of all stands, and everything of those that are open.

    Parameters
    ----------
    bus
        Of the screen's node.
    stands
        Namespaces, or ``ALL``.
    journal
        File of the alarms of all stands; empty: the default file.
    author
        Name stored with acknowledgements and comments made here.
    """

    def __init__(self, bus: Bus[Any], stands: Sequence[str], journal: str, author: str) -> None:
        self._bus, self._journal, self._author = bus, journal, author
        self._buses: dict[str, Bus[Any]] = {}
        self.desks: dict[str, Desk] = {}
        """Desk of each stand, by its namespace."""
        self.on_desk: list[Callable[[str, Desk], None]] = []
        """Called with each stand that is found later."""
        for name in dict.fromkeys(stands):
            if name != ALL:
                self._add(name.strip("/"))
        bus.subscribe(Health, self._take_health)
        if ALL in stands:
            bus.every(LOOK_S, self._look)

    @staticmethod
    def now_ns() -> int:
        """Arrival clock."""
        return Desk.now_ns()

    @property
    def states(self) -> dict[str, OperatorState]:
        """State of each stand."""
        return {name: desk.state for name, desk in self.desks.items()}

    def open(self, name: str) -> Desk:
        """Follow everything of a stand."""
        bus, desk = self._buses[name], self.desks[name]

        def follow() -> None:
            for record_type in STREAMS:
                bus.subscribe(record_type, desk.take)

        self._bus.soon(follow)
        return desk

    def close(self, name: str) -> None:
        """Follow the verdicts of a stand alone again."""
        bus = self._buses[name]

        def leave() -> None:
            for record_type in STREAMS:
                bus.unsubscribe(record_type)

        self._bus.soon(leave)

    def end(self) -> None:
        """Close the journal."""
        for desk in self.desks.values():
            desk.close()

    def _look(self) -> None:
        for name in sorted(namespaces(self._bus, AmbiguityGroup) - set(self.desks)):
            if len(self.desks) < MOST_STANDS:
                self._add(name)

    def _add(self, name: str) -> None:
        bus = StandBus(self._bus, name)
        desk = Desk(open_journal(self._journal, bus), self._author)
        connect(bus, desk, LISTED)
        self._buses[name] = bus
        self.desks = {**self.desks, name: desk}  # a screen may draw in another thread
        for call in self.on_desk:
            call(name, desk)

    def _take_health(self, health: Health) -> None:
        """All stands share the topic of health: a node's name begins with that of its stand."""
        for name, bus in self._buses.items():
            if health.node.startswith(f"{bus.stand}/"):
                self.desks[name].take(health)
