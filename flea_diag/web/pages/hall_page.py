"""The page of all stands: their list, the worst first, and the journal of their alarms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import Client, ui

from flea_diag.operator.alarm import Alarm
from flea_diag.operator.alarm_view import key_text
from flea_diag.operator.hall_view import all_alarms
from flea_diag.web.hall_panels import HallView
from flea_diag.web.pages.button import button
from flea_diag.web.pages.diagnosis_page import SHELVED_FOR, OperatorNode
from flea_diag.web.pages.elements import PanelBody, section
from flea_diag.web.pages.frame import Frame
from flea_diag.web.pages.text_dialog import Said, TextDialog

KEYS = (
    ("a", "acknowledge the latest episode of all stands"),
    ("1 … 9", "open one of the first stands in the list"),
    ("↑ ↓ Enter", "select a stand and open it"),
    ("s, j", "go to the stands, to the alarms"),
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
        button("Acknowledge", "a", self._acknowledge_latest).classes("primary")

    def panels(self) -> None:
        """Add the panels of this page."""
        TextDialog(
            "shelve", "Shelve this alarm", self._shelve, field="Reason", choices=SHELVED_FOR,
            chosen="For", save="Shelve",
        )  # fmt: skip
        TextDialog("comment", "Comment on the episode", self._comment, field="Comment")
        for name, key, title in (
            ("stands", "s", "Stands, the worst first"),
            ("journal", "j", "Alarms of all stands"),
        ):
            with section(name, "scroll", key, title):
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
            ui.notify("No episode to acknowledge.")

    def _acknowledge(self, desk: OperatorNode, alarm: Alarm) -> None:
        self._used = desk
        desk.acknowledge(alarm.key)
        self.tell("Acknowledged.")

    def _comment(self, said: Said) -> None:
        desk, alarm = self._alarm(said.alarm)
        if desk is None or alarm is None:
            self.tell("Not saved: there is no such episode any more.")
            return
        self._used = desk
        desk.comment(alarm.key, said.text)
        self.tell("Saved.")

    def _shelve(self, said: Said) -> None:
        desk, alarm = self._alarm(said.alarm)
        if desk is not None and alarm is not None and said.choice in dict(SHELVED_FOR):
            self._used = desk
            desk.shelve(alarm.key, int(said.choice), said.text)
            self.tell("Shelved.")
