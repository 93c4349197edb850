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
