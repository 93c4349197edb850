"""``ros2 run flea_diag console``: what the stand and its diagnosis say, on a terminal or a pipe."""

from __future__ import annotations

import getpass
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TextIO

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.operator.desk import SAID, Desk, connect, open_journal
from flea_diag.operator.state import SHOWN
from flea_diag.operator.verdict_view import line
from flea_diag.operator.view import page, view
from flea_diag.wire.bus import Bus, Program, run
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import AmbiguityGroup, Record

REDRAW_S = 0.25
CLEAR = "\x1b[H\x1b[2J"
NO_TEXTUAL = "the screen needs Textual: pip install 'flea_diag[console]'"


@dataclass(frozen=True)
class ConsoleParameters:
    """Parameters of the console."""

    style: str = parameter(
        "auto",
        "screen is the console with keys (Textual), page redraws plain text, lines prints one line "
        "a change; auto takes the screen on a terminal, the page where Textual is not installed",
        choices=("auto", "screen", "page", "lines"),
        read_only=True,
    )
    journal: str = parameter(
        "",
        "file of alarms, acknowledgements and comments; empty: flea_diag/alarms.sqlite in "
        "$XDG_STATE_HOME or ~/.local/state",
        read_only=True,
    )
    author: str = parameter("", "who acknowledges and comments; empty: the login", read_only=True)


class Plain:
    """Writes the state as text when it has changed."""

    def __init__(self, desk: Desk, out: TextIO) -> None:
        self._desk, self._out = desk, out
        self._shown = ""

    def verdict(self, record: Record) -> None:
        """Its line at once, if this is one."""
        if isinstance(record, AmbiguityGroup):
            self.line()

    def line(self) -> None:
        """One line a change."""
        self._write(line(self._desk.state, self._desk.now_ns()), end="\n")

    def page(self) -> None:
        """The whole page anew."""
        self._write(page(view(self._desk.state, self._desk.now_ns())), before=CLEAR)

    def _write(self, text: str, before: str = "", end: str = "") -> None:
        if text != self._shown:
            self._shown = text
            self._out.write(before + text + end)
            self._out.flush()


class Screen:
    """The console with keys; has the main thread while the node is served in another."""

    def __init__(self, desk: Desk) -> None:
        from flea_diag.nodes.operator.console_app import ConsoleApp

        self._left = threading.Event()
        self._app = ConsoleApp(desk, self._left.is_set)
        self._desk = desk

    def run(self) -> None:
        """Show it until somebody quits or the node ends."""
        self._app.run()

    def leave(self) -> None:
        """The node has ended; the app looks here with each redraw."""
        self._left.set()

    def close(self) -> None:
        """Close the journal."""
        self._desk.close()


def start(bus: Bus[Any], parameters: ConsoleParameters) -> Callable[[], None] | Screen:
    """Show what comes, on standard output or on the terminal."""
    style = chosen_style(parameters.style, sys.stdout.isatty(), _has_textual())
    author = parameters.author or getpass.getuser()
    desk = Desk(open_journal(parameters.journal, bus.stand), author)
    connect(bus, desk)
    if style == "screen":
        return Screen(desk)
    plain = Plain(desk, sys.stdout)
    if style == "lines":
        # A verdict is printed when it comes, not when somebody looks: two may come in between.
        desk.on_record.append(plain.verdict)
    bus.every(REDRAW_S, plain.line if style == "lines" else plain.page)
    return desk.close


def chosen_style(asked: str, terminal: bool, textual: bool) -> str:
    """Style that is asked for, or that fits.

    Raises
    ------
    ConfigurationError
        The screen is asked for, and Textual is not installed.
    """
    if asked == "screen" and not textual:
        raise ConfigurationError(f"style = 'screen': {NO_TEXTUAL}")
    if asked != "auto":
        return asked
    if not terminal:
        return "lines"
    return "screen" if textual else "page"


def _has_textual() -> bool:
    from importlib.util import find_spec

    return find_spec("textual") is not None


def program() -> Program:
    """What this node is."""
    return Program(
        "console",
        "Shows the verdict, the faults still possible and why, the evidence and the stand's health;"
        " keeps alarms until they are acknowledged.",
        ConsoleParameters,
        start,
        subscribes=(*SHOWN, *SAID),
        publishes=SAID,
        examples=(
            "ros2 run flea_diag console",
            "ros2 run flea_diag console | tee verdicts.txt",
            "ros2 run flea_diag console --ros-args -p style:=page",
            "ros2 run flea_diag console --ros-args -r __ns:=/stand_2",
        ),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run until it is quit, SIGINT or SIGTERM; the exit status."""
    return run(program, argv)


if __name__ == "__main__":
    sys.exit(main())
