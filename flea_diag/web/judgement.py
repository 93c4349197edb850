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

"""Panel of what was judged: tests with their shares, and the faults that were looked for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flea_diag.operator.judgement_view import (
    JUDGED,
    JudgedRow,
    judged_rows,
    judged_text,
    looked_for,
    looked_for_text,
    not_judged,
    not_looked_for,
    of_the_past,
    others_text,
)
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import later, tr
from flea_diag.web.markup import Markup, joined, tag
from flea_diag.web.panels import ledger, state_word
from flea_diag.wire.records import Level

TEST_HEADS = (
    later("test"), later("state"), later("last 10 s"), later("run"), later("why not all"),
)  # fmt: skip
FAULT_HEADS = (later("fault"), later("reason"))


def judgement(state: OperatorState, now_ns: int) -> Markup:
    """What was not judged in the open, the rest on demand."""
    return joined(_tests(state, now_ns), *_faults(state))


def _tests(state: OperatorState, now_ns: int) -> Markup:
    rows = judged_rows(state.quality)
    if not rows:
        return tag("p", tr("no message on what was judged yet"), class_="soft")
    left, past = not_judged(rows), of_the_past(state, now_ns)
    level = Level.STALE if past else Level.WARN if left else Level.OK
    told = f"{past} {judged_text(rows)}" if past else judged_text(rows)
    return joined(
        tag("p", state_word(level, f"{tr(JUDGED)}: {told}")),
        _table(left) if left else None,
        _on_demand("judged", tr("Each of the {count} tests", count=len(rows)), _table(rows)),
    )


def _table(rows: Sequence[JudgedRow]) -> Markup:
    return ledger(TEST_HEADS, (_row(row) for row in rows))


def _row(row: JudgedRow) -> tuple[object, ...]:
    return row.test, state_word(row.level, tr(row.state)), row.recent_text, row.run_text, row.why


def _faults(state: OperatorState) -> Iterable[Markup]:
    """Names on demand, of what was looked for and of what was not."""
    found, hidden = looked_for(state), not_looked_for(state)
    if found:
        names = tag("p", ", ".join(found), class_="comment")
        yield _on_demand("looked-for", looked_for_text(state), names)
    others = [(tr("others"), why)] if (why := others_text(state)) else []
    if hidden or others:
        words = tr("{count} faults not looked for, and why", count=len(hidden))
        title = words if hidden and not others else tr("Faults not looked for, and why")
        yield _on_demand("not-looked-for", title, ledger(FAULT_HEADS, [*hidden, *others]))


def _on_demand(name: str, title: str, content: Markup) -> Markup:
    """By its name what is open stays so when the shares are renewed, and the focus on a title."""
    head = tag("summary", title, data_name=f"{name}-title")
    return tag("details", head, content, data_name=name)
