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

"""The page of one stand: panels are drawn by the server, strip charts by the browser."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import zip_longest
from typing import Any, Protocol

from nicegui import Client, ui

from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.alarm_view import key_text
from flea_diag.operator.fault_entry import FaultEntry
from flea_diag.operator.state import MOST_ALARMS, OperatorState
from flea_diag.operator.unit_decision import ASKED, EXAMPLE, unit_in_question
from flea_diag.operator.words import later, tr
from flea_diag.web.markup import joined
from flea_diag.web.pages.alarm_filter import AlarmFilter
from flea_diag.web.pages.button import button
from flea_diag.web.pages.charts import CHARTS, Chart, Marks, controls, note
from flea_diag.web.pages.elements import PanelBody, Strips, section
from flea_diag.web.pages.frame import Frame
from flea_diag.web.pages.injection import InjectionDialog
from flea_diag.web.pages.report import report_link
from flea_diag.web.pages.text_dialog import Said, TextDialog
from flea_diag.web.strips import StripCharts
from flea_diag.web.view import PANELS, View
from flea_diag.wire.records import NEVER_NS, Record

ORDER = (
    "answer", "group", "symbols", "growth", "residual", "causes", "tree", "episodes", "channel",
    "vibration", "quality", "streams", "judged",
)  # fmt: skip
"""Order of the page: verdict, evidence, history, status of the stand."""
DIGITS = "1234567890"
SHELVED_FOR = (
    ("10", later("10 minutes")), ("60", later("1 hour")), ("480", later("8 hours, a shift"))
)  # fmt: skip
"""Minutes for which an alarm can be shelved."""
OUT_NOW, IN_NOW = "out", "in"
SERVICE = ((OUT_NOW, later("out of service")), (IN_NOW, later("in service")))
KEYS = (
    ("a", later("acknowledge the latest episode")),
    ("c", later("comment on the latest episode")),
    ("m", later("mark this moment")),
    ("f", later("filter the episodes")),
    ("o", later("take the alarms of this stand out of service, or put them back")),
    ("u", later("accept a unit as healthy that differs by more than the calibration allows")),
    ("i", later("inject a fault (simulated stand only)")),
    ("1 … 9, 0", later("go to a panel, in page order")),
)
LEAVE = ("Escape", later("return to the list of all stands"))


class OperatorNode(Protocol):
    """What the page needs of the node that receives the records."""

    state: OperatorState
    trouble: str
    faults: FaultEntry
    on_record: list[Callable[[Record], None]]

    def now_ns(self) -> int:
        """Arrival clock."""

    def acknowledge(self, key: Key) -> None:
        """Acknowledge one alarm."""

    def acknowledge_all(self, keys: Sequence[Key]) -> None:
        """Acknowledge these alarms."""

    def withdraw(self, key: Key) -> None:
        """Withdraw an acknowledgement."""

    def shelve(self, key: Key, minutes: int, reason: str) -> None:
        """Silence one alarm for so long; 0: no longer."""

    def set_service(self, out: bool, reason: str) -> None:
        """Take all alarms out of service, or put them back."""

    def comment(self, key: Key, text: str) -> None:
        """Comment on one alarm."""

    def mark(self, text: str, stamp_ns: int) -> None:
        """Mark a moment."""

    def moment_ns(self) -> int:
        """Present time by the clock of the stand."""

    def decide_on_unit(self, text: str) -> None:
        """Accept the unit on the stand as healthy, or take that back."""


class DiagnosisPage(Frame):
    """The page of one stand in one browser.

    Parameters
    ----------
    desk
        State of the stand, and where remarks go.
    title
        Name in the bar, markup.
    changed
        Called after what a person has done, to draw at once.
    client
        The browser.
    stand
        Name in the list of all stands, to which the page leads back; empty where there is none.
    """

    def __init__(
        self,
        desk: OperatorNode,
        title: str,
        changed: Callable[[], None],
        client: Client,
        stand: str = "",
    ) -> None:
        self._desk, self._stand = desk, stand
        self._bodies: dict[str, PanelBody] = {}
        self._charts: list[Chart] = []
        self._moment_ns = NEVER_NS
        super().__init__(client, title, (*KEYS, LEAVE) if stand else KEYS, changed)

    # -- layout

    def actions(self) -> None:
        """Add the buttons of this page to the bar."""
        button(tr("Acknowledge"), "a", self._acknowledge_latest).classes("primary")
        self._comment_button = button(tr("Comment"), "c", opens="comment")
        button(tr("Mark"), "m", opens="mark")

    def more(self) -> None:
        """Add the buttons that a narrow bar keeps in a menu."""
        button(tr("Service"), "o", opens="service")
        report_link(self._stand)
        self._accept = button(tr("Accept unit"), "u", opens="unit")
        self._accept.set_visibility(False)
        self._injection = InjectionDialog(self._desk)

    def _questions(self) -> None:
        """Add the dialogs of this page."""
        TextDialog(
            "comment", tr("Comment on the episode"), self._comment, field=tr("Comment"),
            example=tr("finding, action taken"),
        )  # fmt: skip
        TextDialog(
            "shelve", tr("Shelve this alarm"), self._shelve, field=tr("Reason"),
            example=tr("part ordered"), choices=SHELVED_FOR, chosen=tr("For"), save=tr("Shelve"),
            about=tr("It does not ring until then, and stays in the list."),
        )  # fmt: skip
        TextDialog(
            "service", tr("Alarms of this stand"), self._set_service, field=tr("Reason"),
            example=tr("maintenance until noon"), choices=SERVICE, chosen=tr("Alarms"),
            about=tr("Out of service they do not ring; they are kept, and the bar says so."),
        )  # fmt: skip
        TextDialog(
            "mark", tr("Mark this moment"), self._mark, field=tr("Text"), preset=tr("mark"),
            opened=self._hold_moment,
        )  # fmt: skip
        self._injection.add_dialog()
        TextDialog("unit", tr(ASKED), self._decide_on_unit, example=tr(EXAMPLE), field=tr("Reason"))

    def panels(self) -> None:
        """Add the panels of this page."""
        self._questions()
        panels = {panel.name: panel for panel in PANELS}
        for name, key in zip_longest(ORDER, DIGITS[: len(ORDER)], fillvalue=""):
            if name in CHARTS:
                self._strips(name, CHARTS[name], key)
                continue
            with section(name, panels[name].css, key, tr(panels[name].title)):
                if name == "episodes":
                    AlarmFilter()
                self._bodies[name] = PanelBody()
                self._bodies[name].on("act", self._act)

    def _strips(self, kind: str, title: str, key: str) -> None:
        with section(kind, "", key, tr(title)):
            ui.html(str(controls(kind)), sanitize=False)
            self._charts.append(Chart(kind, Strips()))
            ui.html(str(joined(note(kind))), sanitize=False, tag="p").classes("note")

    # -- updates

    def show(self, view: View, strips: StripCharts, marks: Marks) -> None:
        """Send the changes."""
        self._injection.offer()
        in_question = unit_in_question(self._desk.state) is not None
        if self._accept.visible != in_question:
            self._accept.set_visibility(in_question)
        self.fill(view)
        for chart in self._charts:
            chart.show(strips, marks)

    def _name_latest(self) -> None:
        """Which episode the button in the bar comments on."""
        alarms = self._desk.state.alarms
        latest = key_text(alarms[-1].key) if alarms else ""
        if self._comment_button.props.get("data-alarm") != latest:
            self._comment_button.props["data-alarm"] = latest
            self._comment_button.props["disabled"] = not latest
            self._comment_button.update()

    def fill(self, view: View) -> None:
        """Show the drawn panels."""
        self._name_latest()
        self.chips.show(view.drawn["chips"])
        for name, body in self._bodies.items():
            body.show(view.drawn[name])

    # -- operator actions

    def trouble(self) -> str:
        """Why what a person has entered cannot be stored; empty if it can."""
        return self._desk.trouble

    def _act(self, event: Any) -> None:
        act, _, name = str(event.args).partition(" ")
        if act == "acks":
            self._acknowledge_all(name.split("\n")[:MOST_ALARMS])
            return
        alarm = self._alarm(name)
        if alarm is None:
            return
        if act == "ack":
            self._acknowledge(alarm)
        elif act == "undo" and alarm.undoable:
            self._desk.withdraw(alarm.key)
            self.tell(tr("The acknowledgement is withdrawn."))
        elif act == "unshelve":
            self._desk.shelve(alarm.key, 0, "")
            self.tell(tr("It rings again."))

    def _alarm(self, name: str) -> Alarm | None:
        return next((a for a in self._desk.state.alarms if key_text(a.key) == name), None)

    def _acknowledge_latest(self) -> None:
        standing = [alarm for alarm in self._desk.state.alarms if alarm.standing]
        if standing:
            self._acknowledge(standing[-1])
        else:
            ui.notify(tr("No episode to acknowledge."))

    def _acknowledge(self, alarm: Alarm) -> None:
        self._desk.acknowledge(alarm.key)
        self.tell(tr("Acknowledged."))

    def _acknowledge_all(self, names: Sequence[str]) -> None:
        """Acknowledge the alarms of a list, as a person has seen it."""
        found = [alarm for name in names if (alarm := self._alarm(name)) and alarm.standing]
        self._desk.acknowledge_all([alarm.key for alarm in found])
        self.tell(tr("{count} acknowledged.", count=len(found)))

    def _comment(self, said: Said) -> None:
        alarm = self._alarm(said.alarm)
        if alarm is None:
            self.tell(tr("Not saved: there is no such episode any more."))
            return
        self._desk.comment(alarm.key, said.text)
        self.tell(tr("Saved."))

    def _shelve(self, said: Said) -> None:
        alarm = self._alarm(said.alarm)
        if alarm is not None and said.choice in dict(SHELVED_FOR):
            self._desk.shelve(alarm.key, int(said.choice), said.text)
            self.tell(tr("Shelved."))

    def _set_service(self, said: Said) -> None:
        self._desk.set_service(said.choice == OUT_NOW, said.text)
        self.tell(tr("Saved."))

    def _decide_on_unit(self, said: Said) -> None:
        if unit_in_question(self._desk.state) is not None:
            self._desk.decide_on_unit(said.text)
            self.tell(tr("Saved."))

    def _hold_moment(self, _: str) -> None:
        self._moment_ns = self._desk.moment_ns()

    def _mark(self, said: Said) -> None:
        self._desk.mark(said.text, self._moment_ns)
        self.tell(tr("Saved."))
