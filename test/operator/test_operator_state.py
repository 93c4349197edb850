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

"""What a screen is shown: folded from records, bounded, and nothing that no record said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.verdicts import FIRST, FLAG, LAST, MS, NOMINAL, START, shown

from flea_diag.operator.journal_state import with_journal, with_losses
from flea_diag.operator.state import (
    MOST_STEPS,
    MOST_SYMBOLS,
    OperatorState,
    aged,
)
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import (
    ChannelInfo,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Health,
    Level,
    Outcome,
    Residual,
    Scan,
    Symbol,
    Symbols,
)


@pytest.mark.parametrize("first", ["hypotheses", "summary"])
def test_summary_and_hypotheses_give_the_whole_verdict_in_either_order(first: str) -> None:
    whole = shown(NOMINAL, FIRST, LAST)
    state = OperatorState()
    for each in (NOMINAL, FIRST, LAST):
        pair = (each.hypotheses(), summary(each))
        state = shown(*(pair if first == "hypotheses" else reversed(pair)), state=state)
    assert repr(state.group) == repr(whole.group)
    assert repr(state.steps) == repr(whole.steps)
    assert repr(state.alarms) == repr(whole.alarms)
    repeated = shown(replace(summary(LAST), seq=7), state=state)
    assert repeated.group is not None
    assert repr(repeated.group.dropped) == repr(LAST.dropped)
    assert repeated.steps is state.steps


def test_a_summary_alone_names_members_and_counts_the_rest() -> None:
    state = shown(NOMINAL, summary(FIRST), summary(LAST))
    assert [step.faults for step in state.steps][-1] == ("jam",)
    assert state.group is not None
    assert (state.group.summary, state.group.dropped_count) == (True, 1)
    older = shown(FIRST.hypotheses(), state=state)
    assert older.group is state.group, "hypotheses of another verdict complete nothing"


def test_the_group_shrinks_step_by_step_and_each_step_says_why() -> None:
    state = shown(NOMINAL, FIRST, replace(FIRST, seq=2), LAST, replace(LAST, seq=4))
    assert [len(step.faults) for step in state.steps] == [0, 3, 1]
    assert state.steps[-1].dropped == (("winding_short", "parity_electrical: it did not move"),)


def test_an_alarm_has_value_limit_and_time_before_any_verdict() -> None:
    (alarm,) = shown(NOMINAL, FLAG).alarms
    assert (alarm.value, alarm.limit, alarm.residual) == (6.5, 5.0, "parity_mechanical_dn")
    assert alarm.detected_ns == START
    assert alarm.rings
    assert alarm.members == ()


def test_one_episode_is_one_alarm_whatever_the_order() -> None:
    for records in ((NOMINAL, FLAG, FIRST, LAST), (NOMINAL, FIRST, FLAG, LAST), (LAST, FLAG)):
        (alarm,) = shown(*records).alarms
        assert (alarm.outcome, alarm.value) == (Outcome.ISOLATED, 6.5)
        assert [member.fault for member in alarm.members] == ["jam"]


def test_a_verdict_repeated_keeps_the_time_at_which_it_was_first_given() -> None:
    (alarm,) = shown(NOMINAL, FIRST, LAST, replace(LAST, seq=9, stamp_ns=START + 9000 * MS)).alarms
    assert alarm.verdict_ns == LAST.stamp_ns


def test_downstream_deviations_are_evidence_inside_the_episode() -> None:
    first = Symbols(START, 1, (Symbol("parity_mechanical", "+", "?", START),))
    later = Symbols(
        START + MS, 1, (*first.symbols, Symbol("nut_temperature", "+", "+", START + MS))
    )
    state = shown(NOMINAL, FLAG, first, FIRST, later, later)
    (alarm,) = state.alarms
    assert [row.residual for row in alarm.deviations] == ["parity_mechanical", "nut_temperature"]
    assert len(state.symbols) == 2


def test_a_detection_inside_an_open_vibration_episode_is_no_second_alarm() -> None:
    vibration = replace(FIRST, detected_stamp_ns=START - 500 * MS)
    assert len(shown(NOMINAL, vibration, FLAG).alarms) == 1


def test_an_episode_that_ended_is_closed_and_stays() -> None:
    state = shown(NOMINAL, FLAG, FIRST, replace(NOMINAL, stamp_ns=START + 9 * MS))
    (alarm,) = state.alarms
    assert alarm.closed_ns == START + 9 * MS
    assert alarm.standing


def test_a_replay_never_rings() -> None:
    (alarm,) = shown(replace(NOMINAL, source="replay"), FLAG).alarms
    assert not alarm.rings
    assert not shown(replace(FIRST, source="replay")).alarms[0].rings


def test_a_detection_without_any_isolator_is_an_alarm_after_a_while() -> None:
    state = shown(FLAG)
    assert aged(state, START + 1000 * MS).alarms == ()
    assert aged(state, START + 2000 * MS).alarms[0].value == 6.5


def test_such_an_alarm_comes_beside_older_ones_and_once() -> None:
    older = replace(shown(NOMINAL, FLAG).alarms[0], detected_ns=START - 10**12)
    state = aged(with_journal(shown(FLAG), (older,)), START + 2000 * MS)
    assert [alarm.detected_ns for alarm in state.alarms] == [older.detected_ns, START]
    said = replace(state.alarms[-1], acknowledged_ns=START + 1, acknowledged_by="me")
    after = aged(with_journal(state, (older, said)), START + 9000 * MS)
    assert not after.alarms[-1].standing, "what was acknowledged does not ring again"


def test_what_the_journal_knows_joins_what_the_records_say() -> None:
    said = replace(shown(NOMINAL, FLAG).alarms[0], acknowledged_ns=START + 1, acknowledged_by="me")
    older = replace(said, detected_ns=START - 10**12)
    state = with_journal(shown(NOMINAL, FLAG, LAST), (older, said))
    assert [alarm.detected_ns for alarm in state.alarms] == [older.detected_ns, START]
    assert state.alarms[-1].outcome is Outcome.ISOLATED
    assert not state.alarms[-1].standing
    assert not shown(LAST, state=state).alarms[-1].standing, "a verdict does not wake it again"


def test_features_asked_answered_and_awaited() -> None:
    asked = FeatureRequest(START, 1, 1, "rms", START - 1, START)
    value = FeatureValue(START + MS, 1, 1, "rms", 0, 1, 2.0, "m/s^2", "+", 0.0, 1.0, "", 0.1)
    second = replace(asked, step=2, feature="kurtosis")
    state = shown(FIRST, asked, value, second)
    assert [(f.name, f.value) for f in state.features] == [("rms", value), ("kurtosis", None)]
    assert shown(value).features[0].value == value, "an answer whose question was not seen"


def scan(number: int) -> Scan:
    return Scan(START + number * 10 * MS, ("motor_current",), (1.0,))


TABLE = ChannelTable(
    START,
    "stand",
    (
        ChannelInfo("motor_current", "A", -10.0, 10.0, 100.0),
        ChannelInfo("accelerometer_1_x", "m/s^2", -500.0, 500.0, 20000.0),
    ),
)


def test_rate_missing_late_and_stale_of_a_stream() -> None:
    numbers = [n for n in range(301) if n not in (40, 41)]
    state = shown(TABLE, *map(scan, numbers), scan(250))
    stream = state.stream(Scan)
    assert stream.received == 300
    assert stream.missing == 2
    assert stream.late == 1
    assert abs(stream.rate_hz - 100.0) < 1e-6
    assert not state.silent(Scan, START + 3100 * MS)
    assert state.silent(Scan, START + 4200 * MS)
    assert state.stream(Residual).standing(START) == "waiting"


def test_losses_that_the_middleware_reports() -> None:
    state = with_losses(shown(scan(0)), {"sensors/slow": 7, "unknown": 3})
    assert state.stream(Scan).lost == 7


def test_stamps_that_go_back_start_a_new_run() -> None:
    state = shown(NOMINAL, FLAG, FIRST, *map(scan, range(500)), scan(0))
    assert state.steps == ()
    assert len(state.alarms) == 1
    assert state.stream(Scan).late == 0


def test_a_long_day_is_no_larger_than_its_bounds() -> None:
    state = shown(NOMINAL)
    for number in range(1000):
        stamp = START + number * MS
        symbol = Symbol("parity_mechanical", "+-"[number % 2], "?", stamp)
        more = replace(FIRST, stamp_ns=stamp, detected_stamp_ns=stamp, episode=number)
        health = Health(stamp, f"node_{number}", Level.OK, "running")
        state = shown(more, Symbols(stamp, number, (symbol,)), health, state=state)
    assert len(state.steps) == MOST_STEPS
    assert len(state.symbols) == MOST_SYMBOLS
    assert len(state.alarms) == 100
    assert len(state.health) == 64
