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

"""500 alarms in a minute: bounded, counted, and no end of them lost to whoever is on shift."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.verdicts import LAST, NOMINAL, START

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm import bounded
from flea_diag.operator.alarm_view import first_out, tally
from flea_diag.operator.shift.shift_report import of_hours, shift_report
from flea_diag.operator.state import MOST_ALARMS

COUNT = 500
STAMPS = [START + k * 60 * 10**9 // COUNT for k in range(COUNT)]


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    made = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Ada")
    made.take(NOMINAL)
    for at_ns in STAMPS:
        made.take(replace(LAST, detected_stamp_ns=at_ns, stamp_ns=at_ns))
    made.tick()
    yield made
    made.close()


def test_the_first_and_the_last_stay_and_all_are_counted(desk: Desk) -> None:
    state = desk.state
    assert len(state.alarms) == MOST_ALARMS
    assert [a.detected_ns for a in state.alarms] == [STAMPS[0], *STAMPS[-99:]]
    assert first_out(state.alarms) == ("live", STAMPS[0])
    assert (state.ringing, state.beyond) == (COUNT, COUNT - MOST_ALARMS)
    told = tally(state)
    assert "400 more of them in the journal" in told
    assert "at most 500 alarms within 10 min: a flood, above 10" in told
    assert "500, 500 not acknowledged" in shift_report({"bay": state}, "bay", STAMPS[-1])


def test_what_is_acknowledged_makes_room_for_what_waits(desk: Desk) -> None:
    """Screen after screen, until nothing rings; what was acknowledged is in the journal."""
    for _ in range(COUNT // MOST_ALARMS):
        assert desk.state.ringing > 0
        desk.acknowledge_all([a.key for a in desk.state.alarms if a.standing])
        desk.tick()
    assert (desk.state.ringing, desk.state.beyond) == (0, 0)
    assert [a.detected_ns for a in desk.state.alarms] == STAMPS[-MOST_ALARMS:]


def test_a_screen_that_starts_later_sees_the_same(desk: Desk, tmp_path: Path) -> None:
    again = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Bob")
    keys = [a.key for a in again.state.alarms]
    assert keys == [a.key for a in desk.state.alarms]
    assert (again.state.ringing, again.state.alarm_times) == (COUNT, tuple(STAMPS))
    again.set_service(True, "maintenance")
    assert again.state.ringing == 0
    again.close()


def test_a_shift_keeps_what_waits_from_before(desk: Desk) -> None:
    now_ns = STAMPS[-1] + 3600 * 10**9
    desk.acknowledge_all([a.key for a in desk.state.alarms[1:]])
    desk.take(replace(LAST, detected_stamp_ns=now_ns, stamp_ns=now_ns))
    before = of_hours(desk.state, 0.5, now_ns)
    assert before.alarm_times == (now_ns,)
    assert all(a.standing or a.detected_ns == now_ns for a in before.alarms)
    assert STAMPS[0] in {a.detected_ns for a in before.alarms}


def test_what_waits_comes_before_what_does_not(desk: Desk) -> None:
    alarms = desk.state.alarms
    quiet = [replace(a, acknowledged_ns=1) for a in alarms[:90]]
    kept = bounded([*quiet, *alarms[90:]], 12)
    assert [a.detected_ns for a in kept] == [a.detected_ns for a in (*quiet[-2:], *alarms[90:])]
    assert bounded(alarms, 3) == (alarms[0], *alarms[-2:])
