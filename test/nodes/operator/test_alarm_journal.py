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

"""Alarms, acknowledgements and comments survive what the process does not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.operator.alarm import Alarm, Comment, Member
from flea_diag.wire.records import Outcome, Remark, RemarkKind, Symbol

ALARM = Alarm(
    "live", 1000, 1, "parity_mechanical", 6.5, 5.0, "mean of 50 samples", Outcome.ISOLATED,
    "the fault is jam", 2000, (Member("jam", 1.0, 12.5, 0.5, "N"),),
    (Symbol("parity_mechanical", "+", "?", 1000),),
)  # fmt: skip
ACKNOWLEDGED = Remark(3000, RemarkKind.ACKNOWLEDGED, "Ada", "", *ALARM.key)
SAID = Remark(4000, RemarkKind.COMMENT, "Ada", "nut greased", *ALARM.key)
MARKED = Remark(5000, RemarkKind.MARK, "Ada", "load changed")


def test_all_of_it_survives_a_restart(tmp_path: Path) -> None:
    journal = AlarmJournal(tmp_path / "new" / "alarms.sqlite")
    journal.note(ALARM)
    for remark in (ACKNOWLEDGED, SAID, MARKED):
        journal.keep(remark)
    journal.close()
    again = AlarmJournal(tmp_path / "new" / "alarms.sqlite")
    (alarm,) = again.alarms()
    assert alarm == replace(
        ALARM,
        acknowledged_ns=3000,
        acknowledged_by="Ada",
        comments=(Comment(4000, "Ada", "nut greased"),),
    )
    assert again.marks() == (Comment(5000, "Ada", "load changed"),)


def test_a_later_verdict_keeps_what_people_said(tmp_path: Path) -> None:
    journal = AlarmJournal(tmp_path / "alarms.sqlite")
    journal.note(replace(ALARM, outcome=Outcome.DETECTED))
    journal.keep(ACKNOWLEDGED)
    journal.note(ALARM)
    (alarm,) = journal.alarms()
    assert (alarm.outcome, alarm.acknowledged_by) == (Outcome.ISOLATED, "Ada")


def test_the_first_acknowledgement_stands(tmp_path: Path) -> None:
    journal = AlarmJournal(tmp_path / "alarms.sqlite")
    journal.note(ALARM)
    journal.keep(ACKNOWLEDGED)
    journal.keep(replace(ACKNOWLEDGED, stamp_ns=4000, author="Bob"))
    journal.keep(replace(ACKNOWLEDGED, detected_ns=77, author="Bob"))
    assert journal.alarms()[0].acknowledged_by == "Ada"


def test_two_screens_share_one_file_and_two_stands_do_not_mix(tmp_path: Path) -> None:
    one, two = (AlarmJournal(tmp_path / "alarms.sqlite") for _ in range(2))
    other = AlarmJournal(tmp_path / "alarms.sqlite", "stand_2")
    before = two.version()
    one.note(ALARM)
    assert two.version() != before
    assert [alarm.key for alarm in two.alarms()] == [ALARM.key]
    assert other.alarms() == ()


def test_unknown_numbers_stay_unknown(tmp_path: Path) -> None:
    journal = AlarmJournal(tmp_path / "alarms.sqlite")
    journal.note(Alarm("live", 1, 1, members=(Member("jam", 0.5, math.nan, math.nan, ""),)))
    (alarm,) = journal.alarms()
    assert math.isnan(alarm.value)
    assert math.isnan(alarm.members[0].size)


def test_the_first_that_waits_and_the_latest_come_back_oldest_first(tmp_path: Path) -> None:
    journal = AlarmJournal(tmp_path / "alarms.sqlite")
    for stamp in (5, 3, 9, 7):
        journal.note(replace(ALARM, detected_ns=stamp))
    assert [alarm.detected_ns for alarm in journal.alarms(2)] == [3, 7, 9]


def test_a_file_that_is_no_journal_is_set_aside(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a data base, but long enough to be told from one" * 20, encoding="utf-8")
    before = path.read_bytes()
    AlarmJournal(path).close()
    (kept,) = tmp_path.glob("notes.txt.damaged-*")
    assert kept.read_bytes() == before
