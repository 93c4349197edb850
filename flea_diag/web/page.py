"""The page in NiceGUI: panels are drawn by the server, strip charts by the browser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, Protocol

from nicegui import Client, ui

from flea_diag.errors import visible
from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.alarm_view import key_text
from flea_diag.operator.fault_entry import FaultEntry
from flea_diag.operator.state import OperatorState
from flea_diag.web.button import button
from flea_diag.web.injection import InjectionDialog
from flea_diag.web.strips import STRETCH_NS, StripCharts
from flea_diag.web.view import PANELS, PagePanel, View

STATIC = Path(__file__).parent / "static"
SPANS_S = (10, 30, 60)
CHARTS = {
    "residual": "Residuals and their limits",
    "channel": "Channels",
    "vibration": "Vibration level",
}
NOTES = {
    "residual": "Blue: residual in standard deviations; orange: limits; ▼ detection, ◆ mark. "
    "Residuals above their limit within the last minute come first; “all” shows the others.",
    "channel": "Blue: measurement; orange: estimate of the state observer with a band of two "
    "standard deviations; ▼ detection, ◆ mark. After a detection the estimate is not corrected by "
    "measurements.",
    "vibration": "Standard deviation and kurtosis of each block; ▼ detection, ◆ mark.",
}
ORDER = (
    "answer", "group", "symbols", "residual", "causes", "tree", "episodes", "channel", "vibration",
    "quality", "streams",
)  # fmt: skip
"""Order of the page: verdict, evidence, history, status of the stand."""
DIGITS = "1234567890"
KEYS = (
    ("a", "acknowledge the latest episode"),
    ("c", "comment on the latest episode"),
    ("m", "mark this moment"),
    ("i", "inject a fault (simulated stand only)"),
    ("d", "switch between light and dark"),
    ("1 … 9, 0", "go to a panel, in page order"),
    ("?", "show this list"),
)


Marks = tuple[tuple[int, str], ...]
"""Stamps of events with their kind, ``detected`` or ``mark``."""


class OperatorNode(Protocol):
    """What the page needs of the node that receives the records."""

    state: OperatorState
    trouble: str
    faults: FaultEntry

    def now_ns(self) -> int:
        """Arrival clock."""

    def acknowledge(self, key: Key) -> None:
        """Acknowledge one alarm."""

    def comment(self, key: Key, text: str) -> None:
        """Comment on one alarm."""

    def mark(self, text: str, stamp_ns: int) -> None:
        """Mark a moment."""

    def moment_ns(self) -> int:
        """Present time by the clock of the stand."""


class PanelBody(ui.element, component="static/panel.js"):
    """Content of a panel."""


class Strips(ui.element, component="static/strip_charts.js"):
    """Strip charts of one kind."""


class Watch(ui.element, component="static/watch.js"):
    """Monitors the connection and the keyboard."""


@dataclass
class Chart:
    """One block of strip charts in one browser, and the state last sent to it."""

    kind: str
    element: Strips
    generation: int = -1
    stretch: int = -1
    marks: Marks = ()

    def show(self, strips: StripCharts, marks: Marks) -> None:
        """Send new rows; after a new run began, the description and all rows."""
        if self.generation != strips.generation:
            self.generation, self.stretch = strips.generation, -1
            about = strips.description(self.kind)
            self.element.run_method("describe", about, columns(about), self._stretch_ns / 1e9)
        rows = strips.after(self.kind, self.stretch)
        if not rows and marks == self.marks:
            return
        self.stretch = rows[-1][0] if rows else self.stretch
        self.marks = marks
        self.element.run_method(
            "push", rows, [{"at": at / self._stretch_ns, "kind": kind} for at, kind in marks]
        )

    @property
    def _stretch_ns(self) -> int:
        return STRETCH_NS[self.kind]


def columns(about: list[dict[str, Any]]) -> int:
    """Number of values in a row of these charts."""
    places = (v for chart in about for k, v in chart.items() if k not in ("name", "unit"))
    return max(places, default=-1) + 1


class Page:
    """One browser's page."""

    def __init__(
        self, desk: OperatorNode, title: str, changed: Callable[[], None], client: Client
    ) -> None:
        self.client = client
        self._desk, self._changed = desk, changed
        self._dark = ui.dark_mode(None)
        ui.add_css(STATIC / "flea.css")
        self._bar(title)
        self._watch = Watch()
        self._bodies: dict[str, PanelBody] = {}
        self._charts: list[Chart] = []
        panels = {panel.name: panel for panel in PANELS}
        with ui.element("main").classes("flea"):
            for name, key in zip_longest(ORDER, DIGITS[: len(ORDER)], fillvalue=""):
                if name in CHARTS:
                    self._strips(name, CHARTS[name], key)
                else:
                    self._panel(panels[name], key)
        self._dialogs()

    # -- layout

    def _bar(self, title: str) -> None:
        with ui.element("div").classes("bar-top flea"):
            ui.html(title, sanitize=False, tag="span").classes("name")
            self._chips = PanelBody()
            ui.element("span").classes("room")
            with ui.element("div").classes("actions"):
                button("Acknowledge", "a", self._acknowledge_latest).classes("primary")
                button("Comment", "c", self._comment_latest)
                button("Mark", "m", self._mark)
                self._injection = InjectionDialog(self._desk)
                button("Light / dark", "d", self._turn)
                button("Keys", "?", self._keys)

    def _panel(self, panel: PagePanel, key: str) -> None:
        with _section(panel.name, panel.css, key, panel.title):
            self._bodies[panel.name] = PanelBody()
            self._bodies[panel.name].on("act", self._act)

    def _strips(self, kind: str, title: str, key: str) -> None:
        with _section(kind, "", key, title + (SPANS if not self._charts else "")):
            self._charts.append(Chart(kind, Strips()))
            ui.html(NOTES[kind], sanitize=False, tag="p").classes("note")

    def _dialogs(self) -> None:
        self._done: Callable[[str], None] = lambda _: None
        with ui.dialog() as self._dialog, ui.card().classes("flea"):
            self._asked = ui.html("", sanitize=False, tag="h3")
            self._said = ui.textarea().props("autofocus outlined").classes("said")
            self._said.on("keydown.enter.prevent", self._say)
            with ui.element("div").classes("actions"):
                button("Save", "Enter", self._say).classes("primary")
                button("Cancel", "Esc", self._dialog.close)
        with ui.dialog() as self._help, ui.card().classes("flea"):
            rows = "".join(f"<kbd>{key}</kbd><span>{words}</span>" for key, words in KEYS)
            ui.html(f"<div class=keys>{rows}</div>", sanitize=False)

    # -- updates

    def show(self, view: View, strips: StripCharts, marks: Marks) -> None:
        """Send the changes."""
        self._watch.run_method("beat", sum(alarm.rings for alarm in self._desk.state.alarms))
        self._injection.offer()
        self.fill(view)
        for chart in self._charts:
            chart.show(strips, marks)

    def fill(self, view: View) -> None:
        """Show the drawn panels."""
        self._set(self._chips, view.drawn["chips"])
        for name, body in self._bodies.items():
            self._set(body, view.drawn[name])

    @staticmethod
    def _set(body: PanelBody, content: str) -> None:
        if body.props.get("content") != content:
            body.props["content"] = content
            body.update()

    # -- operator actions

    def _act(self, event: Any) -> None:
        act, _, name = str(event.args).partition(" ")
        alarm = next((a for a in self._desk.state.alarms if key_text(a.key) == name), None)
        do = {"ack": self._acknowledge, "comment": self._comment}.get(act)
        if alarm is not None and do is not None:
            do(alarm)

    def _acknowledge_latest(self) -> None:
        standing = [alarm for alarm in self._desk.state.alarms if alarm.standing]
        if standing:
            self._acknowledge(standing[-1])
        else:
            ui.notify("No episode to acknowledge.")

    def _acknowledge(self, alarm: Alarm) -> None:
        self._desk.acknowledge(alarm.key)
        self._tell("Acknowledged.")

    def _comment_latest(self) -> None:
        alarms = self._desk.state.alarms
        if alarms:
            self._comment(alarms[-1])
        else:
            ui.notify("No episode to comment on: mark this moment instead.")

    def _comment(self, alarm: Alarm) -> None:
        self._ask("Comment on the episode", "", lambda text: self._desk.comment(alarm.key, text))

    def _mark(self) -> None:
        moment_ns = self._desk.moment_ns()
        self._ask("Mark this moment", "mark", lambda text: self._desk.mark(text, moment_ns))

    def _ask(self, words: str, text: str, done: Callable[[str], None]) -> None:
        self._asked.set_content(words)
        self._said.set_value(text)
        self._done = done
        self._dialog.open()

    def _say(self) -> None:
        self._dialog.close()
        if str(self._said.value or "").strip():
            self._done(str(self._said.value))
            self._tell("Saved.")

    def _tell(self, words: str) -> None:
        trouble = self._desk.trouble
        ui.notify(visible(trouble or words), type="negative" if trouble else None)
        self._changed()

    def _turn(self) -> None:
        ui.run_javascript("return document.body.classList.contains('body--dark')").then(
            lambda dark: self._dark.set_value(not dark)
        )

    def _keys(self) -> None:
        self._help.open()


def _section(name: str, css: str, key: str, title: str) -> ui.element:
    section = ui.element("section").classes(f"panel {css}")
    section.props(f'id=panel-{name} tabindex=-1 data-key="{key}"')
    if title:
        with section:
            ui.html(title, sanitize=False, tag="h2")
    return section


SPANS = (
    "<span class=spans>"
    + "".join(
        f"<button type=button data-span={s} aria-pressed={str(s == 30).lower()}>{s} s</button>"
        for s in SPANS_S
    )
    + "<button type=button data-all aria-pressed=false>all</button></span>"
)
