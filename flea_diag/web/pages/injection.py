"""Fault injection into a simulated stand: a button, visible while such a stand is running."""

from __future__ import annotations

from functools import partial
from queue import SimpleQueue
from typing import Protocol

from nicegui import ui

from flea_diag.errors import visible
from flea_diag.operator.fault_entry import FaultEntry
from flea_diag.web.pages.button import button

WORDS = "Inject a fault into the simulated stand"
EXAMPLE = "jam, or with a size jam:0.5"


class FaultEntryHolder(Protocol):
    """Owner of the interface for fault injection."""

    faults: FaultEntry


class InjectionDialog:
    """Button and dialog in one browser; the stand validates the request."""

    def __init__(self, stand: FaultEntryHolder) -> None:
        self._stand = stand
        self._answers: SimpleQueue[tuple[str, str]] = SimpleQueue()
        self._button = button("Inject", "i", self._open)
        self._button.set_visibility(False)
        with ui.dialog() as self._dialog, ui.card().classes("flea"):
            ui.html(WORDS, sanitize=False, tag="h3")
            self._fault = ui.input(placeholder=EXAMPLE).props("autofocus outlined").classes("said")
            self._fault.on("keydown.enter.prevent", self._put_in)
            with ui.element("div").classes("actions"):
                button("Inject", "Enter", self._put_in).classes("primary")
                button("Clear all faults", "", partial(self._ask, ""))
                button("Leave", "Esc", self._dialog.close)

    def offer(self) -> None:
        """Show the button while a stand accepts faults, and the answers of the stand."""
        if self._button.visible != self._stand.faults.present:
            self._button.set_visibility(self._stand.faults.present)
        while not self._answers.empty():
            fault, why_not = self._answers.get()
            done = f"The stand accepted {fault}." if fault else "The stand cleared all faults."
            ui.notify(
                visible(f"Not injected: {why_not}" if why_not else done),
                type="negative" if why_not else None,
            )

    def _open(self) -> None:
        if self._stand.faults.present:
            self._fault.set_value("")
            self._dialog.open()

    def _put_in(self) -> None:
        fault = str(self._fault.value or "").strip()
        if fault:
            self._ask(fault)

    def _ask(self, fault: str) -> None:
        self._dialog.close()
        # The answer arrives in the thread of the node and is shown at the next redraw.
        self._stand.faults.set(fault, lambda why_not: self._answers.put((fault, why_not)))
