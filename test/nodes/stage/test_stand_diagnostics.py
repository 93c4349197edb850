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

"""The stand as statuses for people's tools: the same words as on topics of its own."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.screens.judgements import GONE, HALF, LOST, WHOLE, shown
from support.verdicts import LAST, NOMINAL, START, group

from flea_diag.nodes.stage.stand_diagnostics import mirrored, serial_of
from flea_diag.wire.records import (
    Cause,
    ChannelInfo,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    JudgedTest,
    Level,
    Outcome,
    Quality,
)


def test_the_verdict_with_its_level_and_members() -> None:
    status = mirrored(LAST, "isolator", START + 1, "EMA-7")
    assert (status.node, status.level, status.message, status.hardware) == (
        "isolator: verdict", Level.ERROR, "words", "EMA-7",
    )  # fmt: skip
    assert dict(status.values)["possible/jam"] == "probability 1: fits"
    assert mirrored(NOMINAL, "isolator", START).level is Level.OK


def test_a_parked_robot_is_ok_with_words() -> None:
    parked = group(Outcome.NOT_OBSERVABLE)
    status = mirrored(parked, "isolator", START)
    assert (status.level, status.message) == (Level.OK, parked.words)


def test_a_replay_raises_nothing() -> None:
    bad = ChannelQuality("motor_voltage", Quality.BAD, START, "stuck at -24 V")
    for status in (
        mirrored(replace(LAST, source="replay"), "isolator", START),
        mirrored(DataQuality(START, (bad,)), "observer", START, live=False),
    ):
        assert status.level is Level.OK
        assert status.message.startswith("replay: ")


def test_the_serial_is_that_of_most_channels() -> None:
    rows = [
        ChannelInfo(f"c{k}", "A", 0.0, 1.0, 100.0, serial=s)
        for k, s in enumerate(["", "A", "B", "B"])
    ]
    assert serial_of(ChannelTable(START, "stand", tuple(rows))) == "B"
    assert serial_of(ChannelTable(START, "stand", tuple(rows[:1]))) == ""


def test_channels_are_as_bad_as_the_worst() -> None:
    rows = (
        ChannelQuality("motor_current", Quality.GOOD, START, ""),
        ChannelQuality("motor_voltage", Quality.BAD, START, "stuck at -24 V"),
    )
    status = mirrored(DataQuality(START, rows), "observer", START)
    assert (status.node, status.level) == ("observer: channels", Level.WARN)
    assert dict(status.values) == {"motor_current": "good", "motor_voltage": "bad: stuck at -24 V"}


def test_channels_with_the_age_of_their_readings_and_the_ledger() -> None:
    rows = (
        ChannelQuality("sensors/slow", Quality.GOOD, START, "", (), START + 3_000_000_000),
        ChannelQuality("motor_current", Quality.GOOD, START, "", (), START + 1_500_000_000),
    )
    judged = (JudgedTest("parity", 0.25, 0.5, False, Cause.MISSING, "load_force lacks all"),)
    status = mirrored(DataQuality(START, rows, (), judged), "observer", START)
    assert (status.level, status.message) == (Level.WARN, "parity not judged")
    assert dict(status.values) == {
        "sensors/slow": "good, last reading 0.0 s ago",
        "motor_current": "good, last reading 1.5 s ago",
        "judged/parity": "not judged, 25% of the last 10 s, 50% of the run: load_force lacks all",
    }


@pytest.mark.parametrize(("load_cell", "said"), [
    (WHOLE, "93% of the last 10 s, 89% of the run: at rest in 7 % of the scans"),
    (HALF, "not judged, 0% of the last 10 s, 35% of the run: load_force lacks all of its readings"),
    (GONE, "not judged, 0% of the last 10 s, 0% of the run: load_force lacks all of its readings"),
])  # fmt: skip
def test_of_a_stand_each_test_and_each_fault(load_cell: str, said: str) -> None:
    state, now_ns = shown(load_cell)
    assert state.quality is not None
    assert state.group is not None
    values = dict(mirrored(state.quality, "observer", now_ns).values)
    assert values["judged/parity_mechanical"] == said
    keys = [key for key in values if key.startswith("judged/")]
    assert len(keys) == len(state.quality.judged)
    assert (keys[: len(LOST)] == [f"judged/{test}" for test in LOST]) == (load_cell != WHOLE)
    verdict = dict(mirrored(state.group, "isolator", now_ns).values)
    assert ("jam" in verdict["looked_for"].split(", ")) == (load_cell == WHOLE)
    assert ("not_observable/jam" in verdict) == (load_cell != WHOLE)
