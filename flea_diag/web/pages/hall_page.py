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

"""The page of all stands: their list, the worst first, and the journal of their alarms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nicegui import Client, ui

from flea_diag.operator.alarm import Alarm
from flea_diag.operator.alarm_view import key_text
from flea_diag.operator.hall_view import MOST_EPISODES, all_alarms
from flea_diag.operator.words import later, tr
from flea_diag.web.hall_panels import HallView
from flea_diag.web.pages.alarm_filter import AlarmFilter
from flea_diag.web.pages.button import button
from flea_diag.web.pages.diagnosis_page import SHELVED_FOR, OperatorNode
from flea_diag.web.pages.elements import PanelBody, section
from flea_diag.web.pages.frame import Frame
from flea_diag.web.pages.report import report_link
from flea_diag.web.pages.text_dialog import Said, TextDialog

KEYS = (
    ("a", later("acknowledge the latest episode of all stands")),
    ("1 … 9", later("open one of the first stands in the list")),
    ("↑ ↓ Enter", later("select a stand and open it")),
    ("s, j", later("go to the stands, to the alarms")),
    ("f", later("filter the episodes")),
)


class HallPage(Frame):
    """The list of all stands in one browser.

    Parameters
    ----------
    desks
        Returns the desk of each stand, by its name.
    title
        Name in the bar, markup.
    changed
        Called after what a person has done, to draw at once.
    client
        The browser.
    """

    title_tag = "h1"

    def __init__(
        self,
        desks: Callable[[], Mapping[str, OperatorNode]],
        title: str,
        changed: Callable[[], None],
        client: Client,
    ) -> None:
        self._desks = desks
        self._bodies: dict[str, PanelBody] = {}
        self._used: OperatorNode | None = None
        super().__init__(client, title, KEYS, changed)

    def actions(self) -> None:
        """Add the buttons of this page to the bar."""
        button(tr("Acknowledge"), "a", self._acknowledge_latest).classes("primary")

    def more(self) -> None:
        """Add the buttons that a narrow bar keeps in a menu."""
        report_link()

    def panels(self) -> None:
        """Add the panels of this page."""
        TextDialog(
            "shelve", tr("Shelve this alarm"), self._shelve, field=tr("Reason"),
            example=tr("part ordered"), choices=SHELVED_FOR, chosen=tr("For"), save=tr("Shelve"),
            about=tr("It does not ring until then, and stays in the list."),
        )  # fmt: skip
        TextDialog(
            "comment", tr("Comment on the episode"), self._comment, field=tr("Comment"),
            example=tr("finding, action taken"),
        )  # fmt: skip
        for name, key, title in (
            ("stands", "s", tr("Stands, the worst first")),
            ("journal", "j", tr("Alarms of all stands")),
        ):
            with section(name, "scroll", key, title):
                if name == "journal":
                    AlarmFilter()
                self._bodies[name] = PanelBody()
                self._bodies[name].on("act", self._act)

    def fill(self, view: HallView) -> None:
        """Show the drawn panels."""
        self.chips.show(view.drawn["chips"])
        for name, body in self._bodies.items():
            body.show(view.drawn[name])

    def trouble(self) -> str:
        """Why what a person has entered cannot be stored; empty if it can."""
        return self._used.trouble if self._used is not None else ""

    def _act(self, event: Any) -> None:
        act, _, name = str(event.args).partition(" ")
        if act == "acks":
            self._acknowledge_all(name.split("\n")[:MOST_EPISODES])
            return
        desk, alarm = self._alarm(name)
        if desk is not None and alarm is not None and act == "ack":
            self._acknowledge(desk, alarm)
        elif desk is not None and alarm is not None and act == "undo" and alarm.undoable:
            desk.withdraw(alarm.key)
        elif desk is not None and alarm is not None and act == "unshelve":
            desk.shelve(alarm.key, 0, "")

    def _alarm(self, name: str) -> tuple[OperatorNode | None, Alarm | None]:
        """Desk and alarm of a button: the name of the stand, and the key."""
        stand, _, key = name.partition(" ")
        desk = self._desks().get(stand)
        alarms = desk.state.alarms if desk is not None else ()
        return desk, next((a for a in alarms if key_text(a.key) == key), None)

    def _acknowledge_latest(self) -> None:
        desks = self._desks()
        found = all_alarms({name: desk.state for name, desk in desks.items()})
        if found and found[0][1].standing:
            self._acknowledge(desks[found[0][0]], found[0][1])
        else:
            ui.notify(tr("No episode to acknowledge."))

    def _acknowledge(self, desk: OperatorNode, alarm: Alarm) -> None:
        self._used = desk
        desk.acknowledge(alarm.key)
        self.tell(tr("Acknowledged."))

    def _acknowledge_all(self, names: Sequence[str]) -> None:
        """Acknowledge the alarms of a list, as a person has seen it."""
        found = [(desk, alarm) for desk, alarm in map(self._alarm, names) if desk and alarm]
        for desk in dict.fromkeys(desk for desk, _ in found):
            self._used = desk
            desk.acknowledge_all([a.key for own, a in found if own is desk and a.standing])
        self.tell(tr("{count} acknowledged.", count=len(found)))

    def _comment(self, said: Said) -> None:
        desk, alarm = self._alarm(said.alarm)
        if desk is None or alarm is None:
            self.tell(tr("Not saved: there is no such episode any more."))
            return
        self._used = desk
        desk.comment(alarm.key, said.text)
        self.tell(tr("Saved."))

    def _shelve(self, said: Said) -> None:
        desk, alarm = self._alarm(said.alarm)
        if desk is not None and alarm is not None and said.choice in dict(SHELVED_FOR):
            self._used = desk
            desk.shelve(alarm.key, int(said.choice), said.text)
            self.tell(tr("Shelved."))
