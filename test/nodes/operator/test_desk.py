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

"""State and journal together, as a screen has them; no ROS in it."""

from __future__ import annotations

import sqlite3
import time
from dataclasses import replace
from pathlib import Path

from support.verdicts import FIRST, FLAG, LAST, NOMINAL, START

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.wire.records import (
    OTHER_UNIT,
    ChannelQuality,
    DataQuality,
    Outcome,
    Quality,
    Remark,
    RemarkKind,
    Scan,
)


def desk(path: Path) -> Desk:
    return Desk(AlarmJournal(path / "alarms.sqlite"), "Ada")


def test_what_people_said_is_there_after_a_restart(tmp_path: Path) -> None:
    one = desk(tmp_path)
    for record in (NOMINAL, FLAG, FIRST):
        one.take(record)
    key = one.state.alarms[0].key
    one.acknowledge(key)
    one.comment(key, "nut greased")
    one.close()
    two = desk(tmp_path)
    for record in (FLAG, LAST):
        two.take(record)
    (alarm,) = two.state.alarms
    assert alarm.outcome is Outcome.ISOLATED
    assert (alarm.acknowledged_by, alarm.comments[0].text) == ("Ada", "nut greased")
    assert not alarm.rings


def test_an_alarm_stays_over_a_restart_until_it_is_acknowledged(tmp_path: Path) -> None:
    one = desk(tmp_path)
    for record in (NOMINAL, FLAG, FIRST, replace(NOMINAL, stamp_ns=START + 10**9)):
        one.take(record)
    one.close()
    two = desk(tmp_path)
    assert [alarm.rings for alarm in two.state.alarms] == [True]
    two.acknowledge(two.state.alarms[0].key)
    assert [alarm.rings for alarm in two.state.alarms] == [False]


def test_one_screen_acknowledges_and_the_other_falls_silent(tmp_path: Path) -> None:
    one, two = desk(tmp_path), desk(tmp_path)
    for screen in (one, two):
        for record in (NOMINAL, FLAG, FIRST):
            screen.take(record)
    one.acknowledge(one.state.alarms[0].key)
    two.tick()
    assert not two.state.alarms[0].rings


def test_a_journal_that_cannot_be_written_is_told_and_the_screen_stays(tmp_path: Path) -> None:
    one = desk(tmp_path)
    other = sqlite3.connect(tmp_path / "alarms.sqlite", isolation_level=None)
    other.execute("DROP TABLE alarm")
    for record in (NOMINAL, FLAG, FIRST):
        one.take(record)
    assert "alarms.sqlite" in one.trouble
    assert one.state.alarms[0].outcome is Outcome.DETECTED


def test_what_another_screen_says_is_kept_once_however_often_it_is_heard(tmp_path: Path) -> None:
    one = desk(tmp_path)
    for record in (NOMINAL, FLAG, FIRST):
        one.take(record)
    key = one.state.alarms[0].key
    said = Remark(START, RemarkKind.COMMENT, "Bob", "greased", *key)
    done = Remark(START, RemarkKind.ACKNOWLEDGED, "Bob", "", *key)
    for remark in (said, done, said, done, Remark(START, RemarkKind.COMMENT, "Bob", " ", *key)):
        one.take(remark)
    (alarm,) = one.state.alarms
    assert (alarm.acknowledged_by, [c.text for c in alarm.comments]) == ("Bob", ["greased"])


def test_a_mark_has_the_stamp_of_the_scan_that_people_see(tmp_path: Path) -> None:
    one = desk(tmp_path)
    said: list[Remark] = []
    one.on_remark.append(said.append)
    one.mark("before any scan")
    one.take(Scan(START + 7, ("motor_current",), (0.0,)))
    one.mark("with the stand")
    assert abs(said[0].stamp_ns - time.time_ns()) < 60 * 10**9
    assert said[1] == Remark(START + 7, RemarkKind.MARK, "Ada", "with the stand")
    one.mark("  ")
    assert len(said) == 2


def test_a_unit_is_accepted_by_name_with_a_reason_and_that_is_taken_back(tmp_path: Path) -> None:
    one = desk(tmp_path)
    said: list[Remark] = []
    one.on_remark.append(said.append)
    one.decide_on_unit("no unit is in question")
    unit = ChannelQuality(OTHER_UNIT, Quality.SATURATED, START + 5, "winding_resistance_ohm +1")
    one.take(DataQuality(START + 5, (unit,)))
    one.take(Scan(START + 7, ("motor_current",), (0.0,)))
    for text in ("rewound", " ", "reject"):
        one.decide_on_unit(text)
    accepted, rejected = RemarkKind.UNIT_ACCEPTED, RemarkKind.UNIT_REJECTED
    assert said == [
        Remark(START + 7, accepted, "Ada", "rewound", "", START + 5),
        Remark(START + 7, rejected, "Ada", "", "", START + 5),
    ]
    kept = AlarmJournal(tmp_path / "alarms.sqlite").marks()
    assert [(mark.author, mark.text) for mark in kept] == [
        ("Ada", "unit accepted: rewound"),
        ("Ada", "unit rejected"),
    ]


def test_marks_are_kept(tmp_path: Path) -> None:
    one = desk(tmp_path)
    one.mark("load changed")
    (mark,) = AlarmJournal(tmp_path / "alarms.sqlite").marks()
    assert (mark.author, mark.text) == ("Ada", "load changed")
