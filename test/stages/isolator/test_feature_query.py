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

"""Which windows an episode asks about: fresh ones, in motion, and not for ever."""

from __future__ import annotations

import math

import pytest
from support.motion_windows import motion, moved

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.stages.isolator.feature_query import FeatureQuery
from flea_diag.stages.isolator.motion_window import MotionWindow
from flea_diag.wire.records import FeatureRequest, FeatureValue

S = 1_000_000_000
NOISY = {"jam": {"0": 0.2, "+": 0.8}, "spall": {"0": 0.8, "+": 0.2}}
CHOOSER = FeatureChooser(
    FaultFeatureTable.from_mapping(
        {
            "features": {"f": {"cost": 1}, "g": {"cost": 2}},
            "faults": {fault: {"f": row, "g": row} for fault, row in NOISY.items()},
        },
        "test",
    )
)
PAIR = {"jam": 0.5, "spall": 0.5}


def answer(request: FeatureRequest, value: float = 1.0) -> FeatureValue:
    return FeatureValue(
        request.stamp_ns + S // 10, request.episode, request.step, request.feature,
        request.window_start_ns, request.window_end_ns, value, "", "0", 0.0, 1.0, "", 0.1,
    )  # fmt: skip


TURNING = motion((60.0, 40.0), (-60.0, 40.0))
ONE_WAY = motion((60.0, 40.0), (60.0, 40.0))


def ask(
    query: FeatureQuery, stamp_ns: int, step: int, motion: MotionWindow = TURNING
) -> FeatureRequest | None:
    query.plan(PAIR, CHOOSER)
    return query.ask(stamp_ns, 1, step) if query.is_due(stamp_ns, motion) else None


def test_windows_begin_after_the_detection_and_follow_each_other_up_to_their_number() -> None:
    query = FeatureQuery(10 * S, S, most_windows=3)
    asked: list[FeatureRequest] = []
    for tenth in range(200):
        request = ask(query, 10 * S + tenth * S // 10, tenth + 1)
        if request is not None:
            asked.append(request)
            assert query.take(answer(request))
    assert [request.feature for request in asked] == ["f", "g"] * 3
    starts = [request.window_start_ns for request in asked]
    assert starts[0] == 10 * S
    for place in (0, 2, 4):
        assert starts[place] == starts[place + 1]
    for place in (2, 4):  # nothing of the window before
        assert starts[place] >= asked[place - 1].window_end_ns
    assert query.computed == ("f", "g")
    assert not query.is_open(10 * S, 0)


def test_a_window_with_a_reversal_is_waited_for_but_not_for_ever() -> None:
    """All fall silent but play at a reversal: a window without says the same of a worn nut."""
    query = FeatureQuery(10 * S, S, most_windows=1)
    assert ask(query, 12 * S, 1, ONE_WAY) is None
    assert ask(query, 12 * S, 1, TURNING) is not None
    patient = FeatureQuery(10 * S, S, most_windows=1)
    assert ask(patient, 13 * S - 1, 1, ONE_WAY) is None
    assert ask(patient, 13 * S, 1, ONE_WAY) is not None
    assert (
        ask(FeatureQuery(10 * S, S, most_windows=1), 13 * S, 1, motion((0.0, 9.0), (0.0, -9.0)))
        is None
    )


@pytest.mark.parametrize(
    ("speed", "waited_s", "due"),
    [(60.0, 0, True), (50.0, 1, False), (50.0, 2, True), (14.0, 3, False), (14.0, 4, True),
     (8.0, 4, True), (6.0, 9, False)],
)  # fmt: skip
def test_the_longer_none_comes_the_slower_a_window_is_taken(speed, waited_s, due) -> None:
    query = FeatureQuery(10 * S, S, most_windows=1)
    query.plan(PAIR, CHOOSER)
    assert query.is_due((11 + waited_s) * S, motion((speed, 40.0), (-speed, 40.0))) is due


@pytest.mark.parametrize(
    ("speed", "waited_s", "due"),
    [(16.0, 0, True), (14.0, 3, False), (8.0, 4, True), (6.0, 9, False)],
)
def test_what_rubs_is_asked_about_in_any_motion(speed, waited_s, due) -> None:
    rows = {"ball_nut_friction": {"f": "0"}, "jam": {"f": "+"}}
    table = {"features": {"f": {"cost": 1}}, "alphabet": ["-", "0", "+"], "faults": rows}
    chooser = FeatureChooser(FaultFeatureTable.from_mapping(table, "test"))
    query = FeatureQuery(10 * S, S, most_windows=1)
    query.plan(dict.fromkeys(rows, 0.5), chooser)
    assert query.is_due((11 + waited_s) * S, motion((speed, 40.0), (-speed, 40.0))) is due


@pytest.mark.parametrize(
    ("speeds", "due"),
    [((50.0, 50.0, 50.0), True), ((50.0, 50.0, 30.0), False), ((50.0, 50.0, 45.0), True),
     ((50.0, 50.0, 50.0, 50.0, 30.0), True), ((50.0, 50.0, 50.0, 50.0, 20.0), False),
     ((54.0, 30.0, 30.0, 30.0), False)],
)  # fmt: skip
def test_of_a_slow_motion_a_window_near_its_fastest_is_taken(speeds, due) -> None:
    query = FeatureQuery(10 * S, S, most_windows=1)
    query.plan(PAIR, CHOOSER)
    assert query.is_due((10 + len(speeds)) * S, moved(*speeds)) is due


def test_while_the_shaft_gathers_pace_a_better_window_is_to_come() -> None:
    query = FeatureQuery(10 * S, S, most_windows=1)
    query.plan(PAIR, CHOOSER)
    gathers = moved(0.0, 0.0)
    for number in range(50):
        gathers.add(12 * S + number * S // 100, float(number), 40.0)
    assert gathers.rises
    assert gathers.reaches(15.0)
    assert not query.is_due(13 * S, gathers)
    for number in range(50, 70):
        gathers.add(12 * S + number * S // 100, 15.0, 40.0)
    assert query.is_due(13 * S + S // 5, gathers)


def test_a_window_is_looked_for_ten_times_a_second_while_one_is_wanted() -> None:
    query = FeatureQuery(0, S, most_windows=1)
    assert not query.looks_out(5 * S)
    query.plan(PAIR, CHOOSER)
    looks = [stamp for stamp in range(5 * S, 6 * S, S // 100) if query.looks_out(stamp)]
    assert len(looks) == 10
    query.ask(6 * S, 1, 1)
    assert not query.looks_out(7 * S)


def test_what_one_window_does_not_give_the_next_one_may() -> None:
    query = FeatureQuery(0, S, most_windows=1)
    first = ask(query, 2 * S, 1)
    assert first is not None
    assert query.take(answer(first, math.nan))
    second = ask(query, 3 * S, 2)
    assert second is not None
    assert (second.feature, second.window_end_ns) == ("g", 3 * S)


def test_a_lost_answer_is_not_asked_for_anew() -> None:
    query = FeatureQuery(0, S, most_windows=3)
    features = []
    for second in range(1, 20):
        request = ask(query, second * S, second)
        if request is not None:
            features.append(request.feature)
            query.give_up()
    assert features == ["f", "g"]


def test_only_the_open_request_is_answered_and_what_has_no_value_is_not_counted() -> None:
    query = FeatureQuery(0, S, most_windows=1)
    request = ask(query, 2 * S, 5)
    assert request is not None
    wrong = answer(FeatureRequest(2 * S, 1, 6, "f", S, 2 * S))
    assert not query.take(wrong)
    assert query.is_open(2 * S, 0)
    assert query.take(answer(request, math.nan))
    assert not query.take(answer(request))
    assert query.computed == ()


def test_patience_for_a_window_ends() -> None:
    query = FeatureQuery(0, S, most_windows=1)
    query.plan(PAIR, CHOOSER)
    assert query.is_open(3 * S, 2 * S)
    assert not query.is_open(3 * S + 1, 2 * S)
