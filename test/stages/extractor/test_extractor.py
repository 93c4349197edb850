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

"""The extractor: lazy, one feature a request, and honest about windows it cannot use."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.stages.extractor.extractor import ExtractorParameters, ExtractorStage
from flea_diag.stages.extractor.vibration_ring import VibrationRing
from flea_diag.wire.records import (
    ChannelInfo,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Record,
    Scan,
    VibrationBlock,
    VibrationLevel,
)

RATE = 2_000.0
SECOND = 1_000_000_000
START = 1_600_000_000 * SECOND
AXES = ("accelerometer_1_x", "accelerometer_1_y", "accelerometer_2_x")
NOISE = np.random.default_rng(0).standard_normal((10_000, 3)).astype(np.float32)
NOISE[:, 2] *= 3.0

TABLE = FaultFeatureTable.from_mapping(
    {
        "title": "two stds",
        "features": {
            "accelerometer_1_std": {"cost": 1},
            "accelerometer_2_std": {"cost": 1},
            "accelerometer_2_rest_std": {"cost": 1},
        },
        "faults": {"jam": {"accelerometer_2_std": "+"}},
        "nominal": {
            "rate_hz": RATE,
            "ranges": {
                "accelerometer_1_std": {"coefficients": [1.0], "low": -0.2, "high": 0.2},
                "accelerometer_2_std": {
                    "coefficients": [0.0, 0.0, 1.0, 0.0],
                    "low": -0.3,
                    "high": 0.3,
                    "speed_rad_s": [0, 300],
                },
            },
        },
    },
    "test table",
)


def blocks(
    until_s: float, length_s: float = 0.1, rate: float = RATE, samples: np.ndarray = NOISE
) -> list[VibrationBlock]:
    count = round(length_s * rate)
    offsets = np.round(np.arange(count) * SECOND / rate).astype(np.int64)
    return [
        VibrationBlock.pack(
            START + round(k * length_s * SECOND), AXES, offsets,
            samples[k * count : (k + 1) * count],
        )
        for k in range(round(until_s / length_s))
    ]  # fmt: skip


def scans(until_s: float, speed: float = 100.0) -> list[Scan]:
    return [
        Scan(START + k * SECOND // 100, ("motor_speed", "load_force"), (speed, 50.0))
        for k in range(round(until_s * 100) + 1)
    ]


def request(
    feature: str, start_s: float, end_s: float, step: int = 1, at_s: float | None = None
) -> FeatureRequest:
    stamp = START + round((end_s if at_s is None else at_s) * SECOND)
    bounds = (START + round(start_s * SECOND), START + round(end_s * SECOND))
    return FeatureRequest(stamp, 1, step, feature, *bounds)


def fed(stage: ExtractorStage, records: Iterable[Record]) -> list[Record]:
    return [caused for record in records for caused in stage.handle(record)]


def stage(**parameters: float) -> ExtractorStage:
    return ExtractorStage(TABLE, ExtractorParameters(**parameters))  # type: ignore[arg-type]


def answers(records: Iterable[Record]) -> list[FeatureValue]:
    return [record for record in records if isinstance(record, FeatureValue)]


def merged(*streams: Iterable[Record]) -> list[Record]:
    rank = {VibrationBlock: 0, Scan: 1, FeatureRequest: 2}
    return sorted(itertools.chain(*streams), key=lambda r: (r.stamp_ns, rank[type(r)]))


def only(stage_: ExtractorStage, *streams: Iterable[Record]) -> FeatureValue:
    found = answers(fed(stage_, merged(*streams)))
    assert len(found) == 1
    return found[0]


def test_answer_is_the_feature_of_the_window_that_was_named() -> None:
    answer = only(stage(), blocks(3.0), scans(3.0), [request("accelerometer_2_std", 1.25, 2.25)])
    expected = NOISE[2500:4500, 2].astype(float).std()
    assert answer.value == pytest.approx(expected, rel=1e-5)
    assert (answer.unit, answer.reason, answer.cost_ms) == ("m/s^2", "", 0.0)
    # Centre 1.0 x 100 rad/s / 100, range +-0.3 (exact), and 3 lies above.
    assert (answer.nominal_low, answer.nominal_high) == pytest.approx((0.7, 1.3))
    assert answer.symbol == "+"
    assert answer.stamp_ns == START + round(2.25 * SECOND) + round(0.15 * SECOND)


def test_symbol_follows_the_operating_point() -> None:
    asked = [request("accelerometer_2_std", 1.0, 2.0)]
    assert only(stage(), blocks(3.0), scans(3.0, 300.0), asked).symbol == "0"
    unknown = only(stage(), blocks(3.0), asked)
    assert unknown.symbol == "?"
    assert unknown.value == pytest.approx(3.0, rel=0.05)
    assert "motor_speed is not measured" in unknown.reason


def test_nothing_is_decoded_until_a_window_is_named_and_then_only_that() -> None:
    lazy = stage(sentinel=False)
    fed(lazy, merged(blocks(3.0), scans(3.0)))
    assert lazy.windows.vibration.decoded_bytes == 0
    lazy.handle(request("accelerometer_2_std", 2.0, 2.5))
    one_axis = 4 * round(0.5 * RATE)
    assert lazy.windows.vibration.decoded_bytes == one_axis
    lazy.handle(request("accelerometer_1_std", 2.0, 2.5, step=2))
    assert lazy.windows.vibration.decoded_bytes == 3 * one_axis


def test_a_window_that_is_asked_about_again_is_not_decoded_again() -> None:
    once, anew = stage(), stage()
    asked = [
        request(feature, 2.0, 2.5, step=step)
        for step, feature in enumerate(("accelerometer_1_std", "accelerometer_1_crest"), start=1)
    ]
    fed(once, merged(blocks(3.0), scans(3.0)))
    first, second = answers(fed(once, asked))
    assert once.windows.vibration.decoded_bytes == 4 * 2 * round(0.5 * RATE)
    fed(anew, merged(blocks(3.0), scans(3.0)))
    assert second.value == answers(fed(anew, asked[1:]))[0].value
    third = answers(once.handle(request("accelerometer_1_std", 1.0, 1.5, step=3)))[0]
    assert third.value != first.value


def test_memory_is_bounded() -> None:
    small = stage(history_s=0.5)
    fed(small, merged(blocks(5.0), scans(5.0)))
    kept = list(small.windows.vibration.blocks(0, START + 10 * SECOND))
    assert len(kept) <= 7
    answer = answers(small.handle(request("accelerometer_1_std", 1.0, 2.0, at_s=5.0)))[0]
    assert math.isnan(answer.value)
    assert "no vibration was received in the window" in answer.reason


def test_request_waits_for_the_block_that_completes_its_window() -> None:
    waiting = stage()
    parts = blocks(3.0)
    fed(waiting, merged(parts[:10], scans(1.0)))
    assert waiting.handle(request("accelerometer_1_std", 0.5, 1.05)) == ()
    fed(waiting, scans(1.04)[101:])
    assert answers(waiting.handle(parts[10])) == []
    (answer,) = answers(waiting.handle(scans(1.05)[-1]))
    assert answer.value == pytest.approx(NOISE[1000:2100, :2].std(axis=0).mean(), rel=0.05)


def test_answer_comes_at_the_latest_when_its_budget_is_over() -> None:
    silent = stage()
    fed(silent, blocks(1.0))
    assert silent.handle(request("accelerometer_1_std", 0.6, 1.4)) == ()
    found = answers(fed(silent, scans(2.0)))
    assert len(found) == 1
    assert math.isnan(found[0].value)
    assert "vibration ends 0.400 s before the window does" in found[0].reason


def test_a_request_later_than_the_last_scan_is_answered_all_the_same() -> None:
    over = stage()
    fed(over, merged(blocks(1.0), scans(2.0)))
    (answer,) = answers(over.handle(request("accelerometer_1_std", 0.6, 1.4)))
    assert "vibration ends 0.400 s before the window does" in answer.reason


def test_pending_requests_are_bounded() -> None:
    flooded = stage(most_pending=3)
    fed(flooded, blocks(0.5))
    found = answers(
        fed(flooded, (request("accelerometer_1_std", 9.0, 10.0, step=k) for k in range(10)))
    )
    assert [answer.step for answer in found] == list(range(7))


def test_repeated_request_is_answered_once() -> None:
    once = stage()
    fed(once, blocks(2.0))
    asked = request("accelerometer_1_std", 0.5, 1.5)
    assert len(answers(fed(once, [asked, asked, asked]))) == 1
    assert once.duplicates == 2


def without(parts: list[VibrationBlock], place: int) -> list[VibrationBlock]:
    return parts[:place] + parts[place + 1 :]


def clipped() -> np.ndarray:
    samples = NOISE.copy()
    samples[2200:2210, 0] = 500.0
    return samples


BROKEN = NOISE.copy()
BROKEN[2500, 0] = np.nan


@pytest.mark.parametrize(
    ("parts", "window", "feature", "reason"),
    [
        ([], (1.0, 2.0), "accelerometer_1_std", "no vibration was received"),
        (blocks(3.0)[15:], (1.0, 2.0), "accelerometer_1_std", "begins 0.500 s after"),
        (without(blocks(3.0), 14), (1.0, 2.0), "accelerometer_1_std", "a gap of 0.100 s"),
        (blocks(3.0), (1.0, 1.01), "accelerometer_1_std", "shorter than 0.05 s"),
        (blocks(3.0, rate=1000.0), (1.0, 2.0), "accelerometer_1_std", "sampled at 1000 Hz"),
        (blocks(3.0, samples=clipped()), (1.0, 2.0), "accelerometer_1_std", "saturated: 10 points"),
        (blocks(3.0, samples=BROKEN), (1.0, 2.0), "accelerometer_1_std", "not finite"),
        (blocks(3.0), (1.0, 2.0), "accelerometer_3_std", "no axis of accelerometer_3"),
        (blocks(3.0), (1.0, 2.0), "accelerometer_1_colour", "unknown"),
        (blocks(3.0), (1.0, 2.0), "accelerometer_2_rest_std", "less than 0.01 s below 10"),
    ],
)
def test_window_that_cannot_be_used_gives_nan_with_the_reason(
    parts: list[VibrationBlock], window: tuple[float, float], feature: str, reason: str
) -> None:
    stand = stage()
    infos = tuple(ChannelInfo(axis, "m/s^2", -500.0, 500.0, RATE) for axis in AXES)
    stand.handle(ChannelTable(START, "stand", infos))
    answer = only(stand, parts, scans(3.0), [request(feature, *window)])
    assert math.isnan(answer.value)
    assert answer.symbol == "?"
    assert reason in answer.reason


def test_feature_without_a_range_has_a_value_and_says_so() -> None:
    answer = only(stage(), blocks(3.0), scans(3.0), [request("accelerometer_1_kurtosis", 1, 2)])
    assert answer.value == pytest.approx(3.0, abs=0.3)
    assert (answer.symbol, "no nominal range" in answer.reason) == ("?", True)


def test_cost_is_read_from_the_stopwatch_that_was_given() -> None:
    ticks = itertools.count(0, 2_500_000)
    timed = ExtractorStage(TABLE, stopwatch=lambda: next(ticks))
    answer = only(timed, blocks(2.0), [request("accelerometer_1_std", 0.5, 1.5)])
    assert answer.cost_ms == 2.5


@settings(max_examples=25, deadline=None)
@given(st.sampled_from([0.02, 0.05, 0.1]), st.integers(0, 2000), st.integers(200, 2000))
def test_value_does_not_depend_on_how_the_stream_was_cut(
    length_s: float, first: int, count: int
) -> None:
    start_s, end_s = first / RATE, (first + count) / RATE
    asked = [request("accelerometer_2_kurtosis", start_s, end_s)]
    whole = only(stage(), blocks(3.0), scans(3.0), asked)
    # By repr: from Python 3.13 on a record with NaN does not equal its like.
    assert repr(only(stage(), blocks(3.0, length_s), scans(3.0), asked)) == repr(whole)


# --- the vibration monitor ------------------------------------------------------------------


def test_level_of_every_block_is_published_at_its_end() -> None:
    records = fed(stage(), blocks(1.0))
    assert [type(record) for record in records] == [VibrationLevel] * 10
    third = records[2]
    assert isinstance(third, VibrationLevel)
    assert third.stamp_ns == START + round(0.3 * SECOND)
    found = np.array([record.std for record in records if isinstance(record, VibrationLevel)])
    np.testing.assert_allclose(np.sqrt(np.mean(found**2, axis=0)), [1.0, 1.0, 3.0], rtol=0.08)

    kurtosis = np.array([r.kurtosis for r in records if isinstance(r, VibrationLevel)])
    np.testing.assert_allclose(kurtosis.mean(axis=0), [3.0, 3.0, 3.0], rtol=0.08)


# --- the ring --------------------------------------------------------------------------------


def test_malformed_repeated_and_old_blocks_are_counted_not_kept() -> None:
    ring = VibrationRing(2.0, 0.002)
    first, second, *_ = blocks(0.5)
    assert ring.add(first)
    assert ring.add(second)
    assert not ring.add(second)
    assert not ring.add(first)
    assert not ring.add(VibrationBlock(second.stamp_ns + SECOND, AXES, 200, b"short"))
    assert not ring.add(VibrationBlock(second.stamp_ns + SECOND, (), 0, b""))
    assert (ring.stale, ring.invalid, ring.restarts) == (2, 2, 0)


def test_jump_back_in_time_starts_afresh() -> None:
    ring = VibrationRing(1.0, 0.002)
    parts = blocks(3.0)
    assert ring.add(parts[29])
    assert ring.add(parts[0])
    assert ring.restarts == 1
    assert ring.end_ns == START + SECOND // 10


@pytest.mark.slow
def test_the_first_answer_of_a_node_does_not_wait_for_imports() -> None:
    """What a feature stands on is loaded before the node listens."""
    code = (
        "import sys\n"
        "from flea_diag.configuration.component import EXTRACTOR\n"
        "assert 'scipy.fft' not in sys.modules\n"
        "EXTRACTOR.warm_up(EXTRACTOR.parameters())\n"
        "assert 'scipy.fft' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
