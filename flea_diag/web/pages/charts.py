"""The strip charts of one page: which there are, and the rows that its browser lacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flea_diag.web.pages.elements import Strips
from flea_diag.web.strips import STRETCH_NS, StripCharts

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
SPANS_S = (10, 30, 60)
SPANS = (
    "<span class=spans>"
    + "".join(
        f"<button type=button data-span={s} aria-pressed={str(s == 30).lower()}>{s} s</button>"
        for s in SPANS_S
    )
    + "<button type=button data-all aria-pressed=false>all</button></span>"
)
"""Buttons for the time shown; in the title of the first block, they hold for all."""

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
