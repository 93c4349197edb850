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

"""A damaged journal is set aside and said once; a broken row costs that row alone."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
from support.verdicts import FIRST, FLAG

from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.nodes.operator.alarm_journal import MOST_COMMENTS, AlarmJournal
from flea_diag.nodes.operator.alarm_row import text_of
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm import Alarm, Member
from flea_diag.wire.records import Outcome, Remark, RemarkKind, Symbol

SOUND = Alarm(
    "live", 1000, 1, "parity_mechanical", 6.5, 5.0, "mean of 50 samples", Outcome.ISOLATED,
    "the fault is jam", 2000, (Member("jam", 1.0, 12.5, 0.5, "N"),),
    (Symbol("parity_mechanical", "+", "?", 1000),),
)  # fmt: skip
OTHER = replace(SOUND, detected_ns=5000)


def changed(**values: Any) -> str:
    return json.dumps({**json.loads(text_of(OTHER)), **values})


def without(name: str) -> str:
    return json.dumps({k: v for k, v in json.loads(text_of(OTHER)).items() if k != name})


BROKEN: dict[str, Any] = {
    "no JSON": "{",
    "null": None,
    "list": "[]",
    "number": "5",
    "bytes": b"\xff\xfe",
    "deep": "[" * 100_000,
    "large": json.dumps("x" * (2 << 20)),
    "no outcome": without("outcome"),
    "unknown outcome": changed(outcome="BETTER"),
    "members of another shape": changed(members=[{"fault": "jam"}]),
    "members no list": changed(members=5),
    "text for a number": changed(value="high"),
    "number for a text": changed(words=5),
    "truth for a stamp": changed(verdict_ns=True),
    "stamp beyond all time": changed(closed_ns=10**30),
    "probability no number": changed(members=[{**asdict(OTHER.members[0]), "probability": "much"}]),
    "another alarm's": changed(detected_ns=77),
}  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "alarms.sqlite"
    with closing(AlarmJournal(path)) as journal:
        journal.note(SOUND)
        journal.note(OTHER)
    return path


def put(path: Path, statement: str, *values: Any) -> None:
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(statement, values)


@pytest.mark.parametrize("record", BROKEN.values(), ids=BROKEN)
def test_a_broken_row_is_left_out_and_said_once(file: Path, record: Any) -> None:
    value = record if record is not None else b""
    put(file, "UPDATE alarm SET record = ? WHERE detected_ns = 5000", value)
    told: list[str] = []
    journal = AlarmJournal(file, say=told.append)
    assert journal.alarms() == (SOUND,)
    assert journal.alarms() == (SOUND,)
    (words,) = told
    assert str(file) in words
    assert "\n" not in words
    assert len(words) < 300 + len(str(file))
    journal.note(OTHER)
    assert journal.alarms() == (SOUND, OTHER)


@pytest.mark.parametrize(
    "change",
    ["detected_ns = 'late'", "acknowledged_ns = 'now'", "acknowledged_by = x'00'", "source = 7.5"],
)
def test_a_column_of_another_kind_breaks_its_row_alone(file: Path, change: str) -> None:
    put(file, f"UPDATE alarm SET {change} WHERE detected_ns = 5000")
    told: list[str] = []
    assert AlarmJournal(file, say=told.append).alarms() == (SOUND,)
    assert len(told) == 1


@pytest.mark.parametrize("stamp", ["soon", b"\x00", 1.5])
def test_a_broken_comment_is_left_out(file: Path, stamp: Any) -> None:
    row = "INSERT INTO comment VALUES ('stand', 'live', 1000, ?, 'Ada', 'greased')"
    put(file, row, stamp)
    put(file, row, 7000)
    told: list[str] = []
    alarms = AlarmJournal(file, say=told.append).alarms()
    assert [said.stamp_ns for said in alarms[0].comments] == [7000]
    assert len(told) == 1


def test_text_that_is_not_utf8_is_shown_as_far_as_it_is(file: Path) -> None:
    row = "INSERT INTO comment VALUES ('stand', 'live', 1000, 1, 'Ada', CAST(x'61ff62' AS TEXT))"
    put(file, row)
    assert AlarmJournal(file).alarms()[0].comments[0].text == "a\ufffdb"


def test_of_many_comments_the_latest_are_read(file: Path) -> None:
    with closing(sqlite3.connect(file)) as db, db:
        rows = [(k, "x" * 10_000) for k in range(MOST_COMMENTS + 500)]
        db.executemany("INSERT INTO comment VALUES ('stand', 'live', 1000, ?, 'Ada', ?)", rows)
    comments = AlarmJournal(file).alarms()[0].comments
    assert [c.stamp_ns for c in comments] == list(range(500, MOST_COMMENTS + 500))
    assert max(len(c.text) for c in comments) == 2000


def garbage(path: Path) -> None:
    path.write_bytes(b"not a database at all, " * 100)


def broken_pages(path: Path) -> None:
    """The head is sound, all that comes after it is not."""
    content = path.read_bytes()
    path.write_bytes(content[:100] + bytes([0xA5]) * (len(content) - 100))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])


@pytest.mark.parametrize("damage", [garbage, broken_pages, cut])
def test_a_damaged_file_is_set_aside_and_work_goes_on(
    file: Path, damage: Callable[[Path], None]
) -> None:
    damage(file)
    content = file.read_bytes()
    told: list[str] = []
    with closing(AlarmJournal(file, say=told.append)) as journal:
        journal.alarms()
        journal.note(SOUND)
        assert journal.alarms() == (SOUND,)
    (kept,) = file.parent.glob("alarms.sqlite.damaged-????-??-??T??????Z")
    assert kept.read_bytes() == content
    (words,) = told
    assert kept.name in words
    with closing(AlarmJournal(file, say=told.append)) as journal:
        assert journal.alarms() == (SOUND,)
    assert len(told) == 1


def test_two_damaged_files_of_one_second_are_both_kept(file: Path) -> None:
    for _ in range(2):
        garbage(file)
        AlarmJournal(file).close()
    assert len(list(file.parent.glob("*.damaged-*"))) == 2


def test_two_screens_set_it_aside_once(file: Path) -> None:
    told: list[str] = []
    one, other = AlarmJournal(file, say=told.append), AlarmJournal(file, say=told.append)
    garbage(file)
    one.note(OTHER)
    other.note(SOUND)
    assert len(told) == len(list(file.parent.glob("*.damaged-*Z"))) == 1
    assert one.alarms() == other.alarms() == (SOUND, OTHER)


def test_the_desk_goes_on_with_the_alarms_it_has(file: Path) -> None:
    journal = AlarmJournal(file)
    desk = Desk(journal, "Ada")
    desk.take(FLAG)
    desk.take(FIRST)
    journal._file._replace(sqlite3.DatabaseError("as if a page were broken"))
    desk.tick()
    desk.tick()
    shown = desk.state.alarms
    assert len(shown) == 3
    desk.acknowledge(shown[-1].key)
    assert desk.trouble == ""
    assert desk.state.alarms[-1].acknowledged_by == "Ada"
    desk.close()
    assert [a.key for a in AlarmJournal(file).alarms()] == [a.key for a in shown]


def test_a_locked_file_is_not_damaged(file: Path) -> None:
    journal = AlarmJournal(file)
    with closing(sqlite3.connect(file, isolation_level=None)) as db:
        db.execute("BEGIN IMMEDIATE")
        with pytest.raises(RecordingError, match="locked"):
            journal.note(replace(SOUND, words="other"))
    journal.note(replace(SOUND, words="other"))
    assert list(file.parent.glob("*.damaged-*")) == []


def test_a_newer_journal_is_not_damaged(file: Path) -> None:
    put(file, "PRAGMA user_version = 99")
    with pytest.raises(ConfigurationError, match="newer"):
        AlarmJournal(file)
    assert [each.name for each in file.parent.glob("*damaged*")] == []


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_regular_file_is_refused_and_stays(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    make(tmp_path / "journal")
    with pytest.raises(ConfigurationError, match="no regular file"):
        AlarmJournal(tmp_path / "journal")
    assert [each.name for each in tmp_path.iterdir()] == ["journal"]


def test_a_remark_that_cannot_be_stored_is_an_error_of_one_line(file: Path) -> None:
    journal = AlarmJournal(file)
    with pytest.raises(RecordingError, match="journal"):
        journal.keep(Remark(4000, RemarkKind.COMMENT, "Ada\udc9b", "x", *SOUND.key))
