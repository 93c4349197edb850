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

"""Recommended next tests that would split the group: advice, never a command to the stand."""

from __future__ import annotations

from flea_diag.operator.panel import Line, Panel
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import tr
from flea_diag.wire.records import NextTest, Outcome


def next_tests(state: OperatorState) -> Panel | None:
    """Tests that would split the remaining group, best gain per second first."""
    group = state.group
    if group is None or group.outcome is not Outcome.INDISTINGUISHABLE or group.summary:
        return None
    if not group.next_tests:
        return Panel("next", f"{tr('NEXT TEST')}  {tr('no known test splits these faults')}")
    tests = group.next_tests
    if all(test.kind == "sensor" for test in tests):
        told = tr("by design no test splits these faults with the sensors of this stand")
    else:
        told = tr("advice; {count} faults remain", count=len(group.members))
    return Panel(
        "next", f"{tr('NEXT TEST')}  {told}", tuple(Line(advice_text(test)) for test in tests)
    )


def advice_text(test: NextTest) -> str:
    """One test with the expected size of the group after it and the faults that it splits."""
    size, splits = f"{test.expected_size:.1f}", ", ".join(test.splits)
    if test.kind == "sensor":
        return tr(
            "fit {what}: expected group size {size} ({splits})",
            what=test.what, size=size, splits=splits,
        )  # fmt: skip
    return tr(
        "{kind} {what}: expected group size {size} after {seconds:.0f} s ({splits})",
        kind=tr(test.kind), what=test.what, size=size, seconds=test.seconds, splits=splits,
    )  # fmt: skip
