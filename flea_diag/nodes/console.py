"""``ros2 run flea_diag console``: the verdict in plain text, on a screen or in a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TextIO

from flea_diag.nodes.console_view import SILENT_AFTER_S, ConsoleState, line, update, view
from flea_diag.wire.bus import Bus, Program, run
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    AmbiguityGroup,
    DataQuality,
    FeatureValue,
    Health,
    Record,
    Truth,
)

SHOWN: tuple[type, ...] = (AmbiguityGroup, DataQuality, FeatureValue, Health, Truth)
REDRAW_S = 0.25
CLEAR = "\x1b[H\x1b[2J"


@dataclass(frozen=True)
class ConsoleParameters:
    """Parameters of the console."""

    style: str = parameter(
        "auto",
        "screen redraws a page, lines prints one line a change, auto takes the page on a terminal",
        choices=("auto", "screen", "lines"),
        read_only=True,
    )


class Console:
    """Keeps the latest records and shows them when they changed."""

    def __init__(self, bus: Bus[Any], out: TextIO, screen: bool) -> None:
        self._out = out
        self._show = self._redraw if screen else self._print_change
        self._state = ConsoleState()
        self._shown = ""
        self._last_verdict_s = time.monotonic()
        for record_type in SHOWN:
            bus.subscribe(record_type, self._take)
        bus.every(REDRAW_S, self._watch)

    def _take(self, record: Record) -> None:
        self._state = update(self._state, record)
        if isinstance(record, AmbiguityGroup):
            self._last_verdict_s = time.monotonic()
            if self._show == self._print_change:
                self._print_change()

    def _watch(self) -> None:
        silent_s = time.monotonic() - self._last_verdict_s
        if silent_s > SILENT_AFTER_S and self._state.group is not None:
            self._state = replace(self._state, silent_s=silent_s)
        self._show()

    def _print_change(self) -> None:
        self._write(line(self._state), end="\n")

    def _redraw(self) -> None:
        self._write(view(self._state), before=CLEAR)

    def _write(self, text: str, before: str = "", end: str = "") -> None:
        if text != self._shown:
            self._shown = text
            self._out.write(before + text + end)
            self._out.flush()


def start(bus: Bus[Any], parameters: ConsoleParameters) -> None:
    """Show what comes on standard output."""
    screen = parameters.style == "screen" or (parameters.style == "auto" and sys.stdout.isatty())
    Console(bus, sys.stdout, screen)


def program() -> Program:
    """What this node is."""
    return Program(
        "console",
        "Shows the verdict, the faults still possible and why, data quality and node health.",
        ConsoleParameters,
        start,
        subscribes=SHOWN,
        examples=(
            "ros2 run flea_diag console",
            "ros2 run flea_diag console | tee verdicts.txt",
            "ros2 run flea_diag console --ros-args -r __ns:=/stand_2",
        ),
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; the exit status."""
    return run(program, argv)


if __name__ == "__main__":
    sys.exit(main())
