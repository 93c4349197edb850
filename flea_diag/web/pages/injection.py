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

"""Fault injection into a simulated stand: a button, visible while such a stand is running."""

from __future__ import annotations

from functools import partial
from queue import SimpleQueue
from typing import Protocol

from nicegui import ui

from flea_diag.errors import visible
from flea_diag.operator.fault_entry import FaultEntry
from flea_diag.operator.words import later, tr
from flea_diag.web.pages.button import button
from flea_diag.web.pages.text_dialog import Said, TextDialog

WORDS = later("Inject a fault into the simulated stand")
EXAMPLE = later("jam, or with a size jam:0.5")


class FaultEntryHolder(Protocol):
    """Owner of the interface for fault injection."""

    faults: FaultEntry


class InjectionDialog:
    """Button and dialog in one browser; the stand validates the request."""

    def __init__(self, stand: FaultEntryHolder) -> None:
        self._stand = stand
        self._answers: SimpleQueue[tuple[str, str]] = SimpleQueue()
        self._button = button(tr("Inject"), "i", opens="inject")
        self._button.set_visibility(False)

    def add_dialog(self) -> None:
        """Add the dialog to the page, not to a menu: a closed menu would hide it."""
        with TextDialog(
            "inject",
            tr(WORDS),
            self._put_in,
            field=tr("Fault"),
            example=tr(EXAMPLE),
            save=tr("Inject"),
        ):
            button(tr("Clear all faults"), "", partial(self._ask, ""), shuts="")

    def offer(self) -> None:
        """Show the button while a stand accepts faults, and the answers of the stand."""
        if self._button.visible != self._stand.faults.present:
            self._button.set_visibility(self._stand.faults.present)
        while not self._answers.empty():
            fault, why_not = self._answers.get()
            done = tr("The stand cleared all faults.")
            if fault:
                done = tr("The stand accepted {fault}.", fault=fault)
            ui.notify(
                visible(tr("Not injected: {why}", why=why_not) if why_not else done),
                type="negative" if why_not else None,
            )

    def _put_in(self, said: Said) -> None:
        self._ask(said.text)

    def _ask(self, fault: str) -> None:
        # The answer arrives in the thread of the node and is shown at the next redraw.
        self._stand.faults.set(fault, lambda why_not: self._answers.put((fault, why_not)))
