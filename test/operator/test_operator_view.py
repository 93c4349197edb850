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

"""Every text of the screens from records alone, and none surer than they are."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from flea_diag.operator.alarm_view import alarm_text, detail
from flea_diag.operator.panel import bar, share
from flea_diag.operator.state import OPEN, OperatorState, fold
from flea_diag.operator.verdict_view import change, why
from flea_diag.operator.verdict_view import line as verdict_line
from flea_diag.operator.view import page
from flea_diag.operator.view import view as panels
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    Candidate,
    ChannelQuality,
    DataQuality,
    Detection,
    Evidence,
    FeatureValue,
    Health,
    Level,
    NextTest,
    Outcome,
    Quality,
    Record,
    Residual,
    Symbol,
    Symbols,
    Truth,
)

# 2023-11-14 22:13:20 UTC, as `date -u -d @1700000000` has it.
NOON_NS = 1_700_000_000 * 10**9

GROUP = AmbiguityGroup(
    stamp_ns=NOON_NS + 1_250_000_000,
    outcome=Outcome.INDISTINGUISHABLE,
    episode=2,
    step=3,
    seq=17,
    members=(
        Candidate(
            "jam", "mechanical_friction+", 0.75, "current high while slow", (), 1.5, 0.1, "N"
        ),
        Candidate("ball_nut_friction", "nut_friction+", 0.25, "no accelerometer says otherwise"),
    ),
    dropped=(Candidate("winding_short", "winding_resistance-", 0.0, "current is too high"),),
    detected_stamp_ns=NOON_NS + 500_000_000,
    words="friction in the mechanism",
    calibration_sha256="ab",
    source="live",
    not_observable=(("spall", "no accelerometer on this stand"),),
    features_computed=("rms",),
    features_available=14,
)


SECOND_NS = 10**9


def shown(*records: Record) -> OperatorState:
    state = OperatorState()
    for record in records:
        state = fold(state, record, 0)
    return state


def line(state: OperatorState, now_ns: int = 0) -> str:
    return verdict_line(state, now_ns)


def view(state: OperatorState, now_ns: int = 0) -> str:
    return page(panels(state, now_ns))


def test_before_the_first_verdict_it_says_so() -> None:
    assert "waiting for ambiguity_group" in view(OperatorState())
    assert line(OperatorState()) == "no verdict yet"


def test_the_verdict_its_members_and_why() -> None:
    text = view(shown(GROUP))
    assert "VERDICT  ERROR  INDISTINGUISHABLE  friction in the mechanism" in text
    assert "episode 2, step 3, number 17, evidence up to 22:13:21.250 UTC, live" in text
    assert "detected at 22:13:20.500 UTC" in text
    assert "POSSIBLE (2)" in text
    assert "75%  mechanical_friction+  size 1.50 ± 0.10 N" in text
    assert "current high while slow" in text
    assert "RULED OUT (1)" in text
    assert "current is too high: winding_short" in text
    assert "no accelerometer on this stand" in text
    assert "FEATURES  1 of 14 computed, 13 not requested" in text
    assert "rms                          computed before this screen started" in text


def test_a_summary_says_what_it_lacks() -> None:
    """Before the hypotheses arrive: every name, a count of the rest, and no advice made up."""
    names = tuple(Candidate(f"fault_{k:02}", "h+", 0.02, "r" * 200) for k in range(50))
    text = view(shown(summary(replace(GROUP, members=names))))
    assert "1. fault_00" in text
    assert "50. fault_49                       ?" in text
    assert "RULED OUT (1)\n  no message on hypotheses yet, which holds the reasons" in text
    assert "NEXT TEST" not in text


def test_one_line_a_change() -> None:
    first = line(shown(GROUP))
    assert first == (
        "22:13:21.250 ERROR INDISTINGUISHABLE (2 possible: jam, ball_nut_friction): "
        "friction in the mechanism"
    )
    named = replace(GROUP, words="one of jam, ball_nut_friction")
    assert line(shown(named)).endswith("INDISTINGUISHABLE (2 possible): " + named.words)
    assert line(shown(GROUP, replace(GROUP, seq=18))) == first
    assert line(shown(GROUP, replace(GROUP, step=4, members=GROUP.members[:1]))) != first


def test_another_order_is_no_change_and_a_long_list_is_shortened() -> None:
    names = [f"fault_{k}" for k in range(9)]

    def told(order: list[str]) -> OperatorState:
        members = tuple(Candidate(name, "h+", 0.1, "fits") for name in order)
        return shown(replace(GROUP, members=members, words=f"one of: {', '.join(order)} (single)"))

    first, other = told(names), told(names[::-1])
    assert change(first, 0) == change(other, 0) != change(told(names[1:]), 0)
    assert line(first).endswith(
        "(9 possible): one of: fault_0, fault_1, fault_2 and 6 more (single)"
    )
    assert "fault_8" in view(first)  # each is listed below the verdict


def test_stale_is_stale_and_not_an_error() -> None:
    state = shown(replace(GROUP, stale=True))
    assert "VERDICT  STALE" in view(state)
    assert "no data from the stand" in view(state)
    assert " STALE " in line(state)


def test_a_silent_isolator_is_told() -> None:
    state = shown(GROUP)
    assert view(state, 4 * SECOND_NS).startswith("NO VERDICT for 4 s")
    assert "NO VERDICT" in line(state, 4 * SECOND_NS)
    assert "NO VERDICT" not in line(fold(state, GROUP, 4 * SECOND_NS), 4 * SECOND_NS)


def test_a_replay_is_called_one() -> None:
    assert "REPLAY: recorded data, not the live stand" in view(
        shown(replace(GROUP, source="replay"))
    )
    assert "REPLAY" not in view(shown(GROUP))


@given(st.floats(0.0, 1.0, exclude_min=True, exclude_max=True))
def test_no_rounding_makes_a_probability_certain(probability: float) -> None:
    assert share(probability).strip() not in ("0%", "100%")
    assert len(share(probability)) == 5


def test_a_fault_that_is_left_alone_gets_no_figure() -> None:
    alone = replace(GROUP, members=(replace(GROUP.members[0], probability=1.0),))
    assert "%" not in view(shown(alone)).split("POSSIBLE")[1].split("RULED OUT")[0]


def test_why_names_time_source_and_path_of_each_finding() -> None:
    found = Evidence(
        NOON_NS, "parity_mechanical", "+?", "+0", "observed +?, predicted +0: fits", "f -> p"
    )
    panel = why(replace(GROUP.members[0], evidence=(found, replace(found, verdict="no words"))))
    assert panel.lines[0].text == (
        "22:13:20.000 parity_mechanical: observed +?, predicted +0: fits  [f -> p]"
    )
    assert panel.lines[1].text == "22:13:20.000 parity_mechanical +?: no words  [f -> p]"


def test_residuals_against_their_limits_and_those_not_formed() -> None:
    nan = float("nan")
    record = Residual(NOON_NS, ("a", "b", "c"), (0.0, 1.0, nan), (1.0, -6.0, nan), (4.0, 5.0, 5.0))
    (panel,) = [p for p in panels(shown(record), 0) if p.name == "residuals"]
    assert panel.title == "RESIDUALS beside their limits, 2 of 3 formed, 22:13:20.000 UTC"
    assert [text.text.split()[0] for text in panel.lines] == ["a", "b", "c"]
    assert panel.lines[1].text.endswith("| -6.00 σ of 5.00 BEYOND")
    assert "BEYOND" not in panel.lines[0].text
    assert panel.lines[2].text.endswith("not formed")


def test_the_list_of_residuals_stands_still_and_begins_with_those_that_deviate() -> None:
    values = (0.0, 0.0, 0.0, 0.0)
    record = Residual(
        NOON_NS,
        ("a", "b_stuck", "c", "d"),
        values,
        (1.0, 51.0, 4.7e-16, 0.5),
        (4.0, 50.0, 5.0, 1.0),
    )
    later = replace(record, stamp_ns=NOON_NS + 1, z=(3.9, 0.0, 5.1, 0.99))
    flag = Detection(NOON_NS, 1, True, "c", 6.0, 5.0, "mean of 50 samples")
    symbol = Symbols(NOON_NS, 1, (Symbol("c", "+", "?", NOON_NS),))
    orders, texts = [], []
    for records in ((record,), (record, later), (flag, symbol, record), (flag, symbol, later)):
        (panel,) = [p for p in panels(shown(*records), 0) if p.name == "residuals"]
        orders.append("".join(text.text[0] for text in panel.lines))
        texts.append(panel.text())
    assert orders == ["abcd", "abcd", "cabd", "cabd"]
    assert "| 51 readings held, limit 50 BEYOND" in texts[0]
    assert "| +0.00 σ of 5.00" in texts[0]
    assert "| 50% of its limit" in texts[0]


def test_a_bar_is_as_long_as_the_share_of_the_limit() -> None:
    assert bar(0.0, 8).strip() == ""
    assert bar(0.5, 8) == "████    "
    assert bar(7.0, 8) == "████████"
    assert bar(float("nan"), 8).strip() == ""


def test_symbols_of_the_open_episode() -> None:
    flag = Detection(NOON_NS, 1, True, "a", 6.0, 5.0, "mean of 50 samples")
    first = Symbols(NOON_NS, 1, (Symbol("a", "+", "?", NOON_NS),))
    later = Symbols(NOON_NS + SECOND_NS, 1, (Symbol("a", "+", "0", NOON_NS),))
    text = view(shown(flag, first, later))
    assert "SYMBOLS  first a at 22:13:20.000 UTC: z = 6, limit 5 (mean of 50 samples)" in text
    assert "+? → +0  since 22:13:20.000" in text
    assert "SYMBOLS" not in view(shown(flag, first, replace(flag, detected=False)))


def test_an_alarm_says_value_limit_evidence_and_time() -> None:
    flag = Detection(NOON_NS, 2, True, "a", 6.25, 5.0, "mean of 50 samples")
    group = replace(GROUP, detected_stamp_ns=NOON_NS)
    later = Symbols(NOON_NS + SECOND_NS, 2, (Symbol("b", "+", "?", NOON_NS + SECOND_NS),))
    quiet = replace(GROUP, detected_stamp_ns=NEVER_NS, members=())
    (alarm,) = shown(quiet, flag, group, later).alarms
    assert alarm_text(alarm) == (
        "22:13:20.000 UTC  a: z = 6.25, limit 5, mean of 50 samples  "
        "INDISTINGUISHABLE: friction in the mechanism"
    )
    text = detail(alarm).text()
    assert "possible jam 75%, size 1.50 ± 0.10 N" in text
    assert "possible ball_nut_friction 25%\n" in text
    assert "evidence 22:13:21.000 b magnitude +, slope ?" in text
    assert "not acknowledged" in text


def test_an_alarm_without_a_known_test_invents_none() -> None:
    (alarm,) = shown(GROUP).alarms
    assert "detection not received" in alarm_text(alarm)
    assert "nan" not in detail(alarm).text()


def test_advice_says_how_far_and_what_it_splits() -> None:
    test = NextTest("motion", "slow to and fro, no load", 8.0, 1.25, ("ball_nut_friction / jam",))
    text = view(shown(replace(GROUP, next_tests=(test,))))
    assert "NEXT TEST  advice; 2 faults remain" in text
    assert (
        "motion slow to and fro, no load: expected group size 1.2 after 8 s "
        "(ball_nut_friction / jam)" in text
    )


def test_what_cannot_be_split_by_design_names_the_sensor() -> None:
    sensor = NextTest("sensor", "accelerometer_2", float("nan"), 1.0, ("ball_nut_friction / jam",))
    text = view(shown(replace(GROUP, next_tests=(sensor,))))
    assert "by design no test splits these faults with the sensors of this stand" in text
    assert "fit accelerometer_2: expected group size 1.0 (" in text
    assert "no known test splits these faults" in view(shown(GROUP))


def test_an_alarm_of_vibration_says_level_and_range() -> None:
    opened_by = "accelerometer_2_x: level 3.1 m/s^2, nominal 0.5 to 2, outside in 6 of 10 blocks"
    state = shown(replace(GROUP, opened_by=opened_by))
    assert opened_by in alarm_text(state.alarms[0])
    assert f"detected at 22:13:20.500 UTC by {opened_by}" in view(state)


def test_streams_are_told_with_their_losses() -> None:
    state = shown(replace(GROUP, seq=1))
    text = view(state, 10 * SECOND_NS)
    assert "ambiguity_group  STALE for 10 s" in text
    assert "sensors/slow     waiting for the first record" in text


def test_features_of_this_episode_only() -> None:
    value = FeatureValue(NOON_NS, 2, 1, "rms", 0, 1, 3.25, "m/s^2", "+", 0.5, 1.5, "", 0.012)
    failed = replace(value, feature="kurtosis", value=float("nan"), reason="window across a gap")
    text = view(shown(GROUP, value, failed))
    assert "3.25 m/s^2" in text
    assert "nominal 0.5 to 1.5" in text
    assert "not computable: window across a gap" in text
    assert "3.25 m/s^2" not in view(shown(GROUP, value, replace(GROUP, episode=3)))


def test_bad_channels_and_nodes() -> None:
    quality = DataQuality(
        NOON_NS,
        (
            ChannelQuality("motor_current", Quality.GOOD, NOON_NS, ""),
            ChannelQuality("motor_voltage", Quality.BAD, NOON_NS, "stuck at -24 V"),
        ),
    )
    health = Health(
        NOON_NS,
        "observer",
        Level.WARN,
        "2 messages passed over",
        (
            ("sensors/slow/received", "100"),
            ("sensors/slow/late", "0"),
            ("sensors/slow/malformed", "2"),
            ("cpu_percent", "3.0"),
        ),
    )
    text = view(shown(quality, health))
    assert "CHANNELS  1 good, 1 not" in text
    assert "motor_voltage                bad since 22:13:20.000: stuck at -24 V" in text
    assert "observer             WARN  2 messages passed over" in text
    assert "sensors/slow/malformed 2" in text
    assert "late 0" not in text


def test_what_the_stand_says_is_marked_as_such() -> None:
    text = view(shown(GROUP, Truth(NOON_NS, "jam", NOON_NS)))
    assert "truth (from the stand): jam since 22:13:20.000 UTC" in text
    assert "truth (from the stand): jam\n" in view(shown(GROUP, Truth(NOON_NS, "jam", NEVER_NS)))


def test_whatever_a_verdict_holds_is_shown_in_its_own_words() -> None:
    """Any outcome, any number of members, unknown sizes: no crash, no other outcome named."""
    for outcome in Outcome:
        for count in (0, 1, 2):
            group = replace(GROUP, outcome=outcome, members=GROUP.members[:count], words="as it is")
            text = view(shown(group))
            title = text.splitlines()[0]
            assert title.endswith(f"{outcome.value}  as it is")
            told = {name.value for name in Outcome if f" {name.value} " in title}
            assert told == {outcome.value}
            possible = outcome in OPEN and count > 0
            unexplained = outcome is Outcome.UNEXPLAINED
            heading = f"NOT RULED OUT ({count})" if unexplained else f"POSSIBLE ({count})"
            assert (heading in text) == possible
            assert "nan" not in text
