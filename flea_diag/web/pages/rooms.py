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

"""What stands behind an address: one stand, or all of them, with the pages open in all browsers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Protocol, TypeVar

from nicegui import Client

from flea_diag.operator.action_view import ringing_text, spoken
from flea_diag.operator.words import tr
from flea_diag.web.answer import unacknowledged
from flea_diag.web.hall_panels import HallView
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.web.pages.diagnosis_page import DiagnosisPage, OperatorNode
from flea_diag.web.pages.hall_page import HallPage
from flea_diag.web.strips import StripCharts
from flea_diag.web.view import Tools, View
from flea_diag.wire.records import AmbiguityGroup, Detection, Hypotheses, Record

MOST_MARKS = 8
"""Largest number of events of a kind in strip charts."""


Sheet = TypeVar("Sheet", DiagnosisPage, HallPage)


class StandRoom:
    """One stand.

    Parameters
    ----------
    desk
        State of the stand.
    tools
        What its pictures need of its description.
    title
        Name in the bar, markup.
    wake
        Called when the pages are to be drawn at once; callable from any thread.
    elsewhere
        Number of alarms that ring on other stands; None where there are none.
    name
        Name in the list of all stands; empty where there is none.
    """

    def __init__(
        self,
        desk: OperatorNode,
        tools: Tools,
        title: str,
        wake: Callable[[], None],
        elsewhere: Callable[[], int] | None = None,
        name: str = "",
    ) -> None:
        self._desk, self._title, self._wake, self._elsewhere = desk, title, wake, elsewhere
        self._name = name
        self._view, self._strips = View(tools), StripCharts()
        self.pages: dict[str, DiagnosisPage] = {}
        if desk.state.channels is not None:
            self._strips.take(desk.state.channels)
        desk.on_record.append(self.take)

    def take(self, record: Record) -> None:
        """Add a record to the strip charts; a new verdict is shown at once."""
        self._strips.take(record)
        if isinstance(record, Detection | Hypotheses | AmbiguityGroup):
            self._wake()

    def enter(self, client: Client) -> None:
        """Make the page of a browser."""
        self._draw()
        page = DiagnosisPage(self._desk, self._title, self._wake, client, self._name)
        page.fill(self._view)
        self.pages[client.id] = page

    def leave(self, client_id: str) -> None:
        """Forget the page of a browser that has gone."""
        self.pages.pop(client_id, None)

    def update(self) -> None:
        """Draw, and send the changes to every browser."""
        if not self.pages:
            return
        elsewhere = self._draw()
        state = self._desk.state
        marks = (
            *((alarm.detected_ns, "detected") for alarm in state.alarms[-MOST_MARKS:]),
            *((mark.stamp_ns, "mark") for mark in state.marks[-MOST_MARKS:]),
        )
        for page in _connected(self.pages):
            with page.client:
                page.beat(state.ringing + elsewhere, spoken(state, self._desk.now_ns()))
                page.show(self._view, self._strips, marks)

    def _draw(self) -> int:
        """Draw the panels; the number of alarms that ring on other stands."""
        self._view.update(self._desk.state, self._desk.now_ns())
        elsewhere = self._elsewhere() if self._elsewhere is not None else 0
        if elsewhere:
            told = unacknowledged(elsewhere, tr(" on other stands"))
            self._view.drawn["chips"] += str(tag("div", *told, class_="chips"))
        return elsewhere


class Stands(Protocol):
    """The desks of all stands."""

    desks: Mapping[str, OperatorNode]

    def open(self, name: str) -> object:
        """Follow everything of a stand."""

    def close(self, name: str) -> None:
        """Follow the verdicts of a stand alone again."""

    def now_ns(self) -> int:
        """Arrival clock."""


class HallRoom:
    """All stands: the list, and a room for each that somebody has opened.

    Parameters
    ----------
    hall
        The desks of all stands.
    tools_of
        What the pictures of a stand need of its description, by its name.
    title
        Name in the bar, markup.
    wake
        Called when the pages are to be drawn at once; callable from any thread.
    """

    def __init__(
        self,
        hall: Stands,
        tools_of: Callable[[str], Tools],
        title: str,
        wake: Callable[[], None],
    ) -> None:
        self._hall, self._tools_of, self._title, self._wake = hall, tools_of, title, wake
        self._view = HallView()
        self._pages: dict[str, HallPage] = {}
        self._rooms: dict[str, StandRoom] = {}

    def enter(self, client: Client) -> None:
        """Make the list of a browser."""
        self._draw()
        page = HallPage(lambda: self._hall.desks, self._title, self._wake, client)
        page.fill(self._view)
        self._pages[client.id] = page

    def enter_stand(self, client: Client, name: str) -> bool:
        """Make the page of a stand in a browser; false if there is no such stand."""
        desk = self._hall.desks.get(name)
        if desk is None:
            return False
        if name not in self._rooms:
            title = joined(_back(), f"flea_diag · {name}")
            self._rooms[name] = StandRoom(
                desk, self._tools_of(name), title, self._wake, lambda: self._ringing(but=name), name
            )
        if not self._rooms[name].pages:
            self._hall.open(name)
        self._rooms[name].enter(client)
        return True

    def leave(self, client_id: str) -> None:
        """Forget the page of a browser that has gone."""
        self._pages.pop(client_id, None)
        for name, room in self._rooms.items():
            if client_id in room.pages:
                room.leave(client_id)
                if not room.pages:
                    self._hall.close(name)

    def update(self) -> None:
        """Draw, and send the changes to every browser."""
        for room in tuple(self._rooms.values()):
            room.update()
        if not self._pages:
            return
        self._draw()
        rings = self._ringing()
        for page in _connected(self._pages):
            with page.client:
                page.beat(rings, ringing_text(rings))
                page.fill(self._view)

    def _draw(self) -> None:
        states = {name: desk.state for name, desk in self._hall.desks.items()}
        self._view.update(states, self._hall.now_ns())

    def _ringing(self, but: str = "") -> int:
        """Number of alarms that ring, on all stands but one."""
        return sum(desk.state.ringing for name, desk in self._hall.desks.items() if name != but)


def _back() -> Markup:
    """Link from the page of a stand to the list."""
    key = tag("kbd", "Esc")
    return tag("a", tr("All stands"), key, href="/", class_="back", data_key="Escape")


def _connected(pages: Mapping[str, Sheet]) -> Iterator[Sheet]:
    """Pages whose browser is there."""
    return (page for page in tuple(pages.values()) if page.client.has_socket_connection)
