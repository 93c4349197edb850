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

"""The life of an alarm after ISA-18.2: shelved, out of service, undone; who, when and why."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.verdicts import FLAG, LAST, NOMINAL

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm import UNDO_NS, Alarm, as_of
from flea_diag.operator.alarm_view import action_text, detail
from flea_diag.wire.records import Remark, RemarkKind


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    made = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Ada")
    for record in (NOMINAL, FLAG, LAST):
        made.take(record)
    yield made
    made.close()


def only(desk: Desk) -> Alarm:
    desk.tick()
    (alarm,) = desk.state.alarms
    return alarm


def test_an_acknowledgement_can_be_undone_for_ten_seconds_and_rings_again(desk: Desk) -> None:
    desk.acknowledge(only(desk).key)
    alarm = only(desk)
    assert (alarm.standing, alarm.rings, alarm.undoable) == (False, False, True)
    later = as_of(alarm, None, alarm.acknowledged_ns + UNDO_NS)
    assert not later.undoable
    desk.withdraw(alarm.key)
    alarm = only(desk)
    assert (alarm.standing, alarm.rings, alarm.undoable) == (True, True, False)
    assert [done.kind for done in alarm.actions] == [RemarkKind.WITHDRAWN]


def test_an_acknowledgement_that_arrives_again_stays_withdrawn(desk: Desk) -> None:
    said: list[Remark] = []
    desk.on_remark.append(said.append)
    desk.acknowledge(only(desk).key)
    desk.withdraw(only(desk).key)
    desk.take(said[0])  # latched: whoever comes later is told it again
    assert only(desk).standing
    desk.acknowledge(only(desk).key)
    assert not only(desk).standing


def test_a_shelved_alarm_is_silent_until_its_time_has_come(desk: Desk) -> None:
    desk.shelve(only(desk).key, 10, "part ordered")
    alarm = only(desk)
    assert (alarm.silenced, alarm.rings, alarm.standing) == ("shelved", False, True)
    done = alarm.actions[-1]
    assert "Ada: shelved until" in action_text(done)
    assert action_text(done).endswith("part ordered")
    assert "shelved: does not ring" in detail(alarm).text()
    assert as_of(alarm, None, done.until_ns - 1).silenced == "shelved"
    assert as_of(alarm, None, done.until_ns).rings
    desk.shelve(alarm.key, 0, "")
    assert only(desk).rings


def test_out_of_service_silences_the_stand_and_survives_a_restart(
    desk: Desk, tmp_path: Path
) -> None:
    desk.set_service(True, "maintenance")
    assert only(desk).silenced == "out of service"
    again = Desk(AlarmJournal(tmp_path / "alarms.sqlite"), "Bob")
    assert again.state.service is not None
    assert again.state.service.text == "maintenance"
    assert again.state.alarms[0].silenced == "out of service"
    again.set_service(False, "done")
    assert again.state.alarms[0].rings
    again.close()
    assert only(desk).rings, "the other screen reads it from the journal that both share"


def test_what_was_done_has_a_name_a_time_and_a_reason(desk: Desk) -> None:
    before_ns = time.time_ns()
    desk.shelve(only(desk).key, 60, "x" * 5000)
    done = only(desk).actions[-1]
    assert before_ns <= done.stamp_ns <= time.time_ns()
    assert (done.author, len(done.text)) == ("Ada", 2000)
    assert done.until_ns - done.stamp_ns == 3600 * 10**9
