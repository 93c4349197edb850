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

"""The list of all stands and the journal of their alarms, as markup."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.hall_view import StandRow, all_alarms, counts, stand_rows
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import later, tr
from flea_diag.web.answer import unacknowledged
from flea_diag.web.guard import STAND_PATH
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.web.panels import CLASS, EPISODE_HEADS, SHAPE, episode_row, ledger
from flea_diag.wire.records import Level

WAITING = "…"
"""Symbol of a stand without a verdict."""
DIGITS = "123456789"
HEADS = (
    "", later("stand"), later("state"), later("evidence to, UTC"), later("verdict"),
    later("alarms"),
)  # fmt: skip


class HallView:
    """Markup of the list; ``drawn`` holds the latest of each panel."""

    def __init__(self) -> None:
        self.drawn: dict[str, str] = {}
        self._rows: tuple[StandRow, ...] | None = None
        self._alarms: list[tuple[Alarm, ...]] | None = None
        self._open_keys: list[Key | None] = []

    def update(self, states: Mapping[str, OperatorState], now_ns: int) -> None:
        """Redraw the panels that have changed."""
        rows = stand_rows(states, now_ns)
        if rows != self._rows:
            self._rows = rows
            self.drawn["chips"] = str(chips(rows))
            self.drawn["stands"] = str(stands(rows))
        alarms = [state.alarms for state in states.values()]
        open_keys = [state.open_key for state in states.values()]
        if open_keys != self._open_keys or not self._is_drawn(alarms):
            self._alarms, self._open_keys = alarms, open_keys
            self.drawn["journal"] = str(journal(states))

    def _is_drawn(self, alarms: list[tuple[Alarm, ...]]) -> bool:
        """Whether these very objects were drawn; comparing their values would cost more."""
        known = self._alarms
        return known is not None and [*map(id, known)] == [*map(id, alarms)]


def address(name: str) -> str:
    """Path of the page of a stand."""
    return STAND_PATH + quote(name)


def chips(rows: tuple[StandRow, ...]) -> Markup:
    """Number of stands in each state, and of alarms not acknowledged."""
    ringing = sum(row.ringing for row in rows)
    if not rows:
        return tag("div", tag("span", tr("no stand found yet"), class_="soft"), class_="chips")
    told = [tag("span", f"{shape(level)} {count} {words}", class_=f"state {css(level)}")
            for level, count, words in counts(rows)]  # fmt: skip
    # A narrow bar cuts off what comes last: how many await somebody comes right after the worst.
    return tag(
        "div",
        *told[:1],
        *unacknowledged(ringing)[:1],
        *told[1:],
        *unacknowledged(ringing)[1:],
        class_="chips",
    )


def shape(level: Level | None) -> str:
    """Symbol of a level."""
    return WAITING if level is None else SHAPE[level]


def css(level: Level | None) -> str:
    """Class of a level."""
    return CLASS[Level.STALE if level is None else level]


def stands(rows: tuple[StandRow, ...]) -> Markup:
    """The stands, the worst first; each leads to its page."""
    if not rows:
        words = tr("No stand has sent a verdict yet. Start its diagnoser, or a fleet.")
        return tag("p", words, class_="soft")
    words_of = {level: words for level, _, words in counts(rows)}
    listed = []
    for number, row in enumerate(rows):
        key = DIGITS[number : number + 1]
        name = tag(
            "a", row.name, href=address(row.name), class_="stand", data_name=row.name,
            data_key=key or None,
        )  # fmt: skip
        age = tag("span", row.age, class_="comment") if row.age else None
        state = f"{shape(row.level)} {words_of[row.level]}"
        listed.append(
            (
                tag("kbd", key) if key else "",
                name,
                tag("span", state, class_=f"state {css(row.level)}"),
                row.heading.partition(" ")[0],
                joined(row.text, age),
                tag("span", f"▲ {row.ringing}", class_="state warn") if row.ringing else "",
            )
        )
    return ledger(HEADS, listed)


def journal(states: Mapping[str, OperatorState]) -> Markup:
    """Alarms of all stands: those not acknowledged on top, then the latest."""
    found = all_alarms(states)
    if not found:
        return tag("p", tr("No episode so far."), class_="soft")
    rows = [
        (
            tag("a", name, href=address(name), class_="stand"),
            *episode_row(alarm, states[name].open_key, name),
        )
        for name, alarm in found
    ]
    return ledger((later("stand"), *EPISODE_HEADS), rows)
