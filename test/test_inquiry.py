"""Which windows an episode asks about: fresh ones, in motion, and not for ever."""

from __future__ import annotations

import math

import pytest

from flea_diag.core.feature_choice import FeatureChooser
from flea_diag.core.feature_table import FaultFeatureTable
from flea_diag.stages.inquiry import Inquiry, Pace
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


def ask(inquiry: Inquiry, stamp_ns: int, step: int) -> FeatureRequest | None:
    inquiry.plan(PAIR, CHOOSER)
    if not inquiry.wanted or not inquiry.is_fresh(stamp_ns):
        return None
    return inquiry.ask(stamp_ns, 1, step)


def test_windows_begin_after_the_detection_and_follow_each_other_up_to_their_number() -> None:
    inquiry = Inquiry(10 * S, S, most_windows=3)
    asked: list[FeatureRequest] = []
    for tenth in range(200):
        request = ask(inquiry, 10 * S + tenth * S // 10, tenth + 1)
        if request is not None:
            asked.append(request)
            assert inquiry.take(answer(request))
    assert [request.feature for request in asked] == ["f", "g"] * 3
    starts = [request.window_start_ns for request in asked]
    assert starts[0] == 10 * S
    for place in (2, 4):  # nothing of the window before
        assert starts[place] >= asked[place - 1].window_end_ns
    assert inquiry.computed == ("f", "g")
    assert not inquiry.is_open(10 * S, 0)


def test_a_lost_answer_is_not_asked_for_anew() -> None:
    inquiry = Inquiry(0, S, most_windows=3)
    features = []
    for second in range(1, 20):
        request = ask(inquiry, second * S, second)
        if request is not None:
            features.append(request.feature)
            inquiry.give_up()
    assert features == ["f", "g"]


def test_only_the_open_request_is_answered_and_what_has_no_value_is_not_counted() -> None:
    inquiry = Inquiry(0, S, most_windows=1)
    request = ask(inquiry, 2 * S, 5)
    assert request is not None
    wrong = answer(FeatureRequest(2 * S, 1, 6, "f", S, 2 * S))
    assert not inquiry.take(wrong)
    assert inquiry.is_open(2 * S, 0)
    assert inquiry.take(answer(request, math.nan))
    assert not inquiry.take(answer(request))
    assert inquiry.computed == ()


def test_patience_for_a_window_ends() -> None:
    inquiry = Inquiry(0, S, most_windows=1)
    inquiry.plan(PAIR, CHOOSER)
    assert inquiry.is_open(3 * S, 2 * S)
    assert not inquiry.is_open(3 * S + 1, 2 * S)


@pytest.mark.parametrize(
    ("speeds", "moving"),
    [([0.0] * 100, False), ([30.0] * 100, True), ([math.nan] * 100, True), ([], True),
     ([60.0] * 100 + [0.0] * 100, False), ([0.0] * 90 + [60.0] * 10, True)],
)  # fmt: skip
def test_the_last_window_moved_or_not(speeds: list[float], moving: bool) -> None:
    pace = Pace(S)
    for number, speed in enumerate(speeds):
        pace.add(number * S // 100, speed)
    assert pace.is_moving is moving
