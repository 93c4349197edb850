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

"""``ros2 run flea_diag console``: verdict, evidence and stand status on a terminal or a pipe."""

from __future__ import annotations

import getpass
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TextIO

from flea_diag.configuration.languages import catalogue
from flea_diag.errors import ConfigurationError, visible
from flea_diag.nodes.operator.desk import SAID, Desk, connect, open_journal
from flea_diag.nodes.operator.hall import Hall
from flea_diag.operator.action_view import in_a_line
from flea_diag.operator.hall_view import hall as listed
from flea_diag.operator.hall_view import stand_rows
from flea_diag.operator.panel import Panel
from flea_diag.operator.state import SHOWN
from flea_diag.operator.verdict_view import change, line
from flea_diag.operator.view import page, view
from flea_diag.operator.words import speak
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import AmbiguityGroup, Level, Record

REDRAW_S = 0.25
CLEAR = "\x1b[H\x1b[2J"
NO_TEXTUAL = f"the screen needs Textual: {sys.executable} -m pip install 'textual>=8.0'"


@dataclass(frozen=True)
class ConsoleParameters:
    """Parameters of the console."""

    style: str = parameter(
        "auto",
        "screen: full-screen console with keys (Textual); page: plain text, redrawn; lines: one "
        "line per change; auto: screen on a terminal (page without Textual), lines elsewhere",
        choices=("auto", "screen", "page", "lines"),
        read_only=True,
    )
    journal: str = parameter(
        "",
        "SQLite file for alarms, acknowledgements and comments; empty: flea_diag/alarms.sqlite "
        "below $XDG_STATE_HOME or ~/.local/state",
        read_only=True,
    )
    author: str = parameter(
        "", "name stored with acknowledgements and comments; empty: login name", read_only=True
    )
    stands: tuple[str, ...] = parameter(
        (),
        "namespaces of the stands to list, worst first, or * for all that are found; empty: the "
        "stand of the node's own namespace",
        read_only=True,
    )
    language: str = parameter(
        "en", "language of the screen: en, de, or the path of a file of texts", read_only=True
    )


class Plain:
    """Writes the state as plain text whenever it has changed; ``before`` stands in each line."""

    def __init__(self, desk: Desk, out: TextIO, before: str = "") -> None:
        self._desk, self._out, self._before = desk, out, before
        self._shown = ""
        self._told: object = ""

    def verdict(self, record: Record) -> None:
        """Print the line of a verdict at once; other records are ignored."""
        if isinstance(record, AmbiguityGroup):
            self.line()

    def line(self) -> None:
        """Print one line if the verdict has changed."""
        state, now_ns = self._desk.state, self._desk.now_ns()
        changed = change(state, now_ns)
        if changed == self._told:
            return
        self._told = changed
        self._write(self._before + line(state, now_ns) + in_a_line(state), end="\n")

    def page(self) -> None:
        """Print the whole page if it has changed."""
        self._write(page(view(self._desk.state, self._desk.now_ns())), before=CLEAR)

    def _write(self, text: str, before: str = "", end: str = "") -> None:
        if text != self._shown:
            self._shown = text
            self._out.write(before + visible(text) + end)
            self._out.flush()


class PlainHall:
    """Writes the states of several stands as plain text whenever they have changed."""

    def __init__(self, hall: Hall, out: TextIO) -> None:
        self._hall, self._out = hall, out
        self._plain: dict[str, Plain] = {}
        self._shown = ""

    def lines(self) -> None:
        """Print one line for each stand whose verdict has changed."""
        for name, desk in self._hall.desks.items():
            if name not in self._plain:
                self._plain[name] = Plain(desk, self._out, f"{name}  ")
                desk.on_record.append(self._plain[name].verdict)
            self._plain[name].line()

    def page(self) -> None:
        """Print the list, and the page of the worst stand if it has a fault."""
        now_ns, states = Desk.now_ns(), self._hall.states
        panels = [listed(states, now_ns)]
        worst = stand_rows(states, now_ns)[:1]
        if worst and worst[0].level is Level.ERROR:
            panels += [Panel("worst", worst[0].name.upper()), *view(states[worst[0].name], now_ns)]
        text = page(tuple(panels))
        if text != self._shown:
            self._shown = text
            self._out.write(CLEAR + visible(text))
            self._out.flush()


class Screen:
    """The full-screen console; it runs in the main thread, the node in another."""

    def __init__(self, make: Callable[[Callable[[], bool]], Any], end: Callable[[], None]) -> None:
        self._left = threading.Event()
        self._app = make(self._left.is_set)
        self._end = end

    def run(self) -> None:
        """Show the screen until the operator quits or the node ends."""
        self._app.run()

    def leave(self) -> None:
        """Note that the node has ended; the app checks this at each redraw."""
        self._left.set()

    def close(self) -> None:
        """Close the journal."""
        self._end()


def start(bus: Bus[Any], parameters: ConsoleParameters) -> Callable[[], None] | Screen:
    """Show incoming records on standard output or on the terminal."""
    style = chosen_style(parameters.style, sys.stdout.isatty(), _has_textual())
    speak(*catalogue(parameters.language))
    author = parameters.author or getpass.getuser()
    if parameters.stands:
        return _start_hall(bus, Hall(bus, parameters.stands, parameters.journal, author), style)
    desk = Desk(open_journal(parameters.journal, bus), author)
    connect(bus, desk)
    if style == "screen":
        from flea_diag.nodes.operator.console_app import ConsoleApp

        return Screen(partial(ConsoleApp, desk), desk.close)
    plain = Plain(desk, sys.stdout)
    if style == "lines":
        # A verdict is printed on arrival, not with the timer: two may arrive between two ticks.
        desk.on_record.append(plain.verdict)
    bus.every(REDRAW_S, plain.line if style == "lines" else plain.page)
    return desk.close


def _start_hall(bus: Bus[Any], hall: Hall, style: str) -> Callable[[], None] | Screen:
    if style == "screen":
        from flea_diag.nodes.operator.console_hall import HallApp

        return Screen(partial(HallApp, hall), hall.end)
    plain = PlainHall(hall, sys.stdout)
    bus.every(REDRAW_S, plain.lines if style == "lines" else plain.page)
    return hall.end


def chosen_style(asked: str, terminal: bool, textual: bool) -> str:
    """Style to use: the one requested, or for ``auto`` the one that suits the output.

    Raises
    ------
    ConfigurationError
        ``screen`` is requested but Textual is not installed.
    """
    if asked == "screen" and not textual:
        raise ConfigurationError(f"style = 'screen': {NO_TEXTUAL}")
    if asked != "auto":
        return asked
    if not terminal:
        return "lines"
    return "screen" if textual else "page"


def check(parameters: ConsoleParameters) -> None:
    """Refuse a style that cannot be shown, or a language that there is not."""
    catalogue(parameters.language)
    chosen_style(parameters.style, sys.stdout.isatty(), _has_textual())


def _has_textual() -> bool:
    from importlib.util import find_spec

    return find_spec("textual") is not None


def program() -> Program:
    """Description of this node."""
    return Program(
        "console",
        "Shows the verdict, the possible faults with their reasons, the evidence and the status of "
        "the stand; keeps alarms until they are acknowledged.",
        ConsoleParameters,
        start,
        subscribes=(*SHOWN, *SAID),
        publishes=SAID,
        examples=(
            "ros2 run flea_diag console",
            "ros2 run flea_diag console | tee verdicts.txt",
            "ros2 run flea_diag console --ros-args -p style:=page",
            "ros2 run flea_diag console --ros-args -r __ns:=/stand_2",
            "ros2 run flea_diag console --ros-args -p stands:=\"['bay_1', 'bay_2']\"",
            "ros2 run flea_diag console --ros-args -p stands:=\"['*']\"",
            "ros2 run flea_diag console --ros-args -p language:=de",
        ),
        check=check,
    )
