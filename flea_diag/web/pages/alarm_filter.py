"""Choice of the alarms that a list shows; the browser hides the others by itself."""

from __future__ import annotations

from nicegui import ui

from flea_diag.operator.shift.alarm_filter import FILTERS
from flea_diag.operator.words import later, tr
from flea_diag.web.pages.elements import STATIC

WORDS = {
    "show": later("Show"),
    "with": later("containing"),
    "count": later("{shown} of {count} shown"),
    "all": later("Acknowledge all shown"),
    "sure": later("Acknowledge these {count}?"),
}


class AlarmFilter(ui.element, component=STATIC / "alarm_filter.js"):
    """Filter above the list of alarms in the same section; it also acknowledges what is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.props["filters"] = [[name, tr(words)] for name, (words, _) in FILTERS.items()]
        self.props["words"] = {name: tr(words) for name, words in WORDS.items()}
