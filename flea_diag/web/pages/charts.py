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

"""The strip charts of one page: which there are, and the rows that its browser lacks."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

from flea_diag.operator.words import later, tr
from flea_diag.web.markup import Markup, tag
from flea_diag.web.pages.elements import Strips
from flea_diag.web.strips import STRETCH_NS, StripCharts

CHARTS = {
    "residual": later("Residuals and their limits"),
    "channel": later("Channels"),
    "vibration": later("Vibration level"),
}
HELP = later(
    "Drag over a chart to zoom all of them, double-click to follow the clock again; the cursor "
    "shows its moment in every chart. Times are UTC."
)
EVENTS = later("▼ solid line: detection; ◆ dotted line: mark.")
NOTES = {
    "residual": (
        later("Blue: residual; dashed orange: limits, with the band between them."),
        EVENTS,
        later(
            "Residuals above their limit within the last minute come first; “all” shows the others."
        ),
        HELP,
    ),
    "channel": (
        later(
            "Blue: measurement; orange: estimate of the state observer with a band of two standard "
            "deviations."
        ),
        EVENTS,
        later("After a detection the estimate is not corrected by measurements."),
    ),
    "vibration": (later("Standard deviation and kurtosis of each block."), EVENTS),
}
SPANS_S = {10: later("10 s"), 30: later("30 s"), 60: later("1 min"), 600: later("10 min")}
FIRST_SPAN_S = 30
SENT_S = 0.5
"""Rows go out so often: a browser spends more on each message than on the rows in it."""
SAID = {
    "none": later("no value"),
    "limit": later("limit"),
    "of": later("strip chart of {name}"),
}
ACTIONS = (
    ("onset", later("Onset"), later("jump to the latest detection")),
    ("pause", later("Pause"), later("hold the charts")),
    ("png", "PNG", later("save a picture of these charts")),
    ("csv", "CSV", later("save the values in view")),
)


def note(kind: str) -> str:
    """What stands below a block: how its charts are to be read."""
    return " ".join(map(tr, NOTES[kind]))


def controls(kind: str) -> Markup:
    """Buttons above a block: those of the first hold for all, and each exports its own charts."""
    first = kind == next(iter(CHARTS))
    spans = [
        tag(
            "button", tr(words), type="button", data_span=seconds,
            aria_pressed=str(seconds == FIRST_SPAN_S).lower(),
        )
        for seconds, words in SPANS_S.items()
    ]  # fmt: skip
    rest = [
        tag(
            "button", tr(words), type="button", data_strip=name, title=tr(why),
            aria_pressed="false" if name == "pause" else None,
        )
        for name, words, why in ACTIONS
        if first or name in ("png", "csv")
    ]  # fmt: skip
    every = tag("button", tr("all"), type="button", data_strip="all", aria_pressed="false")
    shown = [*spans, *rest, every] if first else rest
    return tag("div", *shown, class_="spans")


def said() -> dict[str, str]:
    """What the charts say by themselves."""
    return {name: tr(words) for name, words in SAID.items()}


Marks = tuple[tuple[int, str], ...]
"""Stamps of events with their kind, ``detected`` or ``mark``."""


@dataclass
class Chart:
    """One block of strip charts in one browser, and the state last sent to it."""

    kind: str
    element: Strips
    generation: int = -1
    stretch: int = -1
    marks: Marks = ()
    sent_s: float = -math.inf

    def show(self, strips: StripCharts, marks: Marks) -> None:
        """Send new rows; after a new run began, the description and all rows."""
        now_s = time.monotonic()
        if self.generation != strips.generation:
            self.generation, self.stretch = strips.generation, -1
            about = strips.description(self.kind)
            past = strips.past(self.kind)
            self.element.run_method(
                "describe", about, columns(about), self._stretch_ns / 1e9, past, said()
            )
        elif marks == self.marks and now_s - self.sent_s < SENT_S:
            return
        rows = strips.after(self.kind, self.stretch)
        if not rows and marks == self.marks:
            return
        self.stretch = rows[-1][0] if rows else self.stretch
        self.marks, self.sent_s = marks, now_s
        self.element.run_method(
            "push", rows, [{"at": at / 1e9, "kind": kind} for at, kind in marks]
        )

    @property
    def _stretch_ns(self) -> int:
        return STRETCH_NS[self.kind]


def columns(about: list[dict[str, Any]]) -> int:
    """Number of values in a row of these charts."""
    places = (v for chart in about for k, v in chart.items() if k not in ("name", "unit"))
    return max(places, default=-1) + 1
