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

"""Stamps that step back: a new run where several in a row do, else a single wrong stamp."""

from __future__ import annotations

from typing import Any

from flea_diag.nodes.stage.stream_stamps import BACK_NS, FOLLOWERS, StreamStamps
from flea_diag.wire.records import ChannelTable, Record, Scan

START_NS = 100 * BACK_NS
STEP_NS = BACK_NS // 100


class Heard:
    """Health of a node, as far as stamps concern it."""

    def __init__(self) -> None:
        self.late = self.accepted = 0

    def arrived(self, record_type: type, stamp_ns: int, late: bool) -> None:
        self.late += late

    def taken(self) -> None:
        self.accepted += 1


def scan(stamp_ns: int) -> Scan:
    return Scan(stamp_ns, ("position",), (0.0,))


def stamps() -> tuple[Any, Heard, list[tuple[str, int]]]:
    begun: list[tuple[str, int]] = []
    heard: Any = Heard()
    made = StreamStamps(heard, lambda why, from_ns: begun.append((why, from_ns)))
    assert made.due(scan(START_NS)) == (scan(START_NS),)
    return made, heard, begun


def test_a_single_step_back_is_held_and_let_go_behind_the_stream() -> None:
    made, heard, begun = stamps()
    assert made.due(scan(0)) == ()
    assert not made.goes_on([START_NS + STEP_NS])
    assert made.due(scan(START_NS + STEP_NS)) == (scan(0), scan(START_NS + STEP_NS))
    assert (heard.late, heard.accepted, begun) == (1, 2, [])


def test_a_small_step_back_is_late_and_no_more() -> None:
    made, heard, begun = stamps()
    assert made.due(scan(START_NS - BACK_NS)) == (scan(START_NS - BACK_NS),)
    assert (heard.late, begun) == (1, [])


def test_steps_back_in_a_row_are_a_new_run_with_all_that_was_held() -> None:
    made, _, begun = stamps()
    again = [scan(number * STEP_NS) for number in range(FOLLOWERS)]
    due: list[tuple[Record, ...]] = [made.due(record) for record in again]
    assert due == [()] * (FOLLOWERS - 1) + [tuple(again)]
    assert begun == [("Scan stamps stepped back by 99.9 s", 0)]
    assert made.goes_on([FOLLOWERS * STEP_NS, (FOLLOWERS + 1) * STEP_NS])


def test_scans_that_do_not_rise_are_taken_one_by_one() -> None:
    made, heard, _ = stamps()
    assert not made.goes_on([START_NS + STEP_NS, START_NS + STEP_NS])
    assert made.goes_on([START_NS, START_NS + STEP_NS])
    assert heard.accepted == 2


def test_a_latched_record_may_be_of_any_age() -> None:
    made, _, begun = stamps()
    table = ChannelTable(0, "stand", ())
    assert made.due(table) == (table,)
    assert begun == []
