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

"""The report of a shift: journal, page and report agree; nothing in it is markup of others."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest
from support.places import ROOT
from support.verdicts import FLAG, LAST, NOMINAL, START, shown

from flea_diag.nodes.operator.alarm_journal import AlarmJournal
from flea_diag.nodes.operator.desk import Desk
from flea_diag.operator.alarm_view import cause
from flea_diag.operator.shift.shift_report import shift_report
from flea_diag.operator.state import OperatorState
from flea_diag.operator.words import speaking
from flea_diag.tools.main import main
from flea_diag.tools.replay.report import shift
from flea_diag.web.panels import episodes
from flea_diag.wire.records import Record

MADE = START + 3600 * 10**9


def test_desk_and_recording_give_the_same_report(tmp_path: Path) -> None:
    """What a screen keeps in its journal and what the recorder keeps of it are one shift."""
    kept: list[Record] = []
    desk = Desk(AlarmJournal(tmp_path / "a.sqlite"), "Ada")
    desk.on_remark.append(kept.append)
    for record in (NOMINAL, FLAG, LAST):
        desk.take(record)
        kept.append(record)
    (alarm,) = desk.state.alarms
    desk.acknowledge(alarm.key)
    desk.withdraw(alarm.key)
    desk.shelve(alarm.key, 10, "part ordered")
    desk.comment(alarm.key, "nut is <hot>")
    desk.mark("load changed", START + 10**9)
    desk.acknowledge(alarm.key)
    report = shift_report({"bay": desk.state}, "bay", MADE)
    assert report == shift_report({"bay": shift(kept)}, "bay", MADE)
    for words in (
        "part ordered",
        "nut is &lt;hot&gt;",
        "load changed",
        "withdrawn",
    ):
        assert words in report
    (alarm,) = desk.state.alarms
    assert cause(alarm) in report
    page = str(episodes(desk.state))
    second = time.strftime("%H:%M:%S", time.gmtime(alarm.acknowledged_ns // 10**9))
    assert second in page
    assert second in report
    desk.close()


def test_a_flood_of_alarms_with_hostile_and_long_names_stays_bounded() -> None:
    name = "<img src=x>" + "n" * 200
    state = OperatorState()
    for k in range(500):
        at_ns = START + k * 10**8
        member = replace(LAST.members[0], fault=name)
        verdict = replace(
            LAST, detected_stamp_ns=at_ns, stamp_ns=at_ns, members=(member,), words=name
        )
        state = shown(verdict, state=state)
    report = shift_report({name: state}, name, MADE)
    assert "a flood" in report
    assert "<img" not in report
    assert len(report) < 1_000_000


def test_an_empty_shift_has_a_report() -> None:
    assert "0, 0 not acknowledged" in shift_report({"bay": OperatorState()}, "bay", MADE)


def test_the_command_writes_it(tmp_path: Path) -> None:
    target = tmp_path / "shift.html"
    bag = ROOT / "bags" / "live_motor_current_bias"
    assert main(["report", str(bag), "-o", str(target)]) == 0
    text = target.read_text("utf-8")
    assert "ISOLATED: the fault is motor_current_bias" in text
    assert "1, 1 not acknowledged" in text


def test_several_recordings_make_one_report(tmp_path: Path) -> None:
    """Also where they have the same name: then their paths tell them apart."""
    bag = ROOT / "bags" / "live_motor_current_bias"
    target, other = tmp_path / "shift.html", tmp_path / bag.name
    shutil.copytree(bag, other)
    assert main(["report", str(bag), str(other), "-o", str(target)]) == 0
    text = target.read_text("utf-8")
    assert "2, 2 not acknowledged" in text
    assert text.count(f"<td>{other}</td>") == 2  # as a stand, and before its alarm


def test_the_command_speaks_german(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "shift.html"
    bag = str(ROOT / "bags" / "live_motor_current_bias")
    with speaking("en", {}):
        assert main(["report", bag, "-o", str(target), "--language", "de"]) == 0
        assert main(["report", bag, "-o", str(target), "--language", "xx"]) != 0
    text = target.read_text("utf-8")
    assert 'lang="de"' in text
    assert "Schichtbericht" in text
    assert "Der Fehler ist motor_current_bias." in text
    assert "en, de" in capsys.readouterr().err
