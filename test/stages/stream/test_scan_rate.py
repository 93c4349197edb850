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

"""Stamps at another rate, that jitter or that step: said of the stream, and no fault."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import stands
from support.observer_scans import decisions, healthy, jammed, quality

from flea_diag.stages.stream.scan_rate import ScanRate
from flea_diag.stages.stream.stream_order import StreamOrder
from flea_diag.wire.records import (
    STREAM,
    AmbiguityGroup,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Scan,
)

PERIOD_NS = 10_000_000


def order(stamps_ns: Iterable[int]) -> StreamOrder:
    known = StreamOrder(PERIOD_NS, 10)
    for stamp_ns in stamps_ns:
        known.step(stamp_ns)
    return known


def every(hz: float, scans: int = 200) -> list[int]:
    return [round(k * 1e9 / hz) for k in range(scans)]


@pytest.mark.parametrize("hz", [50, 80, 95, 99, 105, 120, 160])
def test_another_rate_is_known_after_a_hundred_scans(hz: float) -> None:
    known = order(every(hz))
    assert known.rate.off_hz == pytest.approx(hz, rel=1e-4)
    assert f"scans come at {hz:g} Hz" in known.state().reason


@pytest.mark.parametrize("hz", [99.97, 100, 100.2])
def test_the_rate_of_the_calibration_is_none(hz: float) -> None:
    assert order(every(hz, 1000)).rate.off_hz == 0.0


def test_two_sources_half_a_period_apart_are_one_of_twice_the_rate() -> None:
    assert "200 Hz (two sources?)" in order(every(200.0)).state().reason


@pytest.mark.parametrize("jitter_ms", [0.5, 2.0, 3.0])
def test_jitter_is_no_rate_and_is_said(jitter_ms: float) -> None:
    rng = np.random.default_rng(round(jitter_ms))
    known = StreamOrder(PERIOD_NS, 10)
    for k in range(5000):
        known.step(round(k * PERIOD_NS + rng.normal(0.0, jitter_ms * 1e6)))
        assert known.rate.off_hz == 0.0
    assert ("stamps jitter" in known.state().reason) is (jitter_ms > 1.0)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.sampled_from((10_000_000, 12_500_000, 9_000_000, 10_300_000)), max_size=400),
    st.lists(st.integers(1, 90), min_size=1, max_size=20),
)
def test_blocks_end_before_the_scan_that_changes_what_is_said(
    steps: list[int], sizes: list[int]
) -> None:
    one, many = ScanRate(PERIOD_NS), ScanRate(PERIOD_NS)
    stamps_ns = np.cumsum([0, *steps])
    turns = [k for k, ahead in enumerate(steps) if one.step(ahead, 0)]
    found, at = [], 0
    while at < len(steps):
        size = sizes[at % len(sizes)]
        before_ns, block = int(stamps_ns[at]), stamps_ns[at + 1 : at + 1 + size]
        count = many.leading(before_ns, block)
        if count:
            many.follow(before_ns, block[:count])
        elif many.step(steps[at], 0):
            found.append(at)
        at += count or 1
    assert found == turns
    assert many.off_hz == one.off_hz


def set_back(scans: list[Scan], by_ms: float, at: int) -> list[Scan]:
    return [
        scan if k < at else replace(scan, stamp_ns=scan.stamp_ns - round(by_ms * 1e6))
        for k, scan in enumerate(scans)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("by_ms", [-16.0, 6.0, 20.0, 100.0, 1000.0])
def test_a_clock_that_is_set_is_said_and_is_no_fault(by_ms: float) -> None:
    out = stands.replay(stands.observer(), set_back(healthy(), by_ms, 900))
    assert decisions(out) == []
    row = quality(stands.of(DataQuality, out)[-1], STREAM)
    assert dict(row.counters)["steps"] == 1
    assert "1 steps of the clock" in row.reason


def test_a_jam_after_a_clock_was_set_is_found_as_soon() -> None:
    at_s = [
        stands.of(Detection, stands.replay(stands.observer(), scans))[0].stamp_ns / 1e9
        for scans in (jammed(), set_back(jammed(), 6.0, 700))
    ]
    assert at_s[1] == pytest.approx(at_s[0], abs=0.1)


def last(records: list[Record]) -> AmbiguityGroup:
    return stands.of(AmbiguityGroup, records)[-1]


@pytest.mark.slow
@pytest.mark.parametrize("hz", [80.0, 99.0, 120.0])
def test_a_stream_at_another_rate_is_refused_by_name(hz: float) -> None:
    scans = [
        replace(scan, stamp_ns=round(stands.START_NS + k * 1e9 / hz))
        for k, scan in enumerate(jammed())
    ]
    out = stands.replay(stands.pipeline(), [stands.table(), *scans])
    assert stands.of(Detection, out) == []
    assert last(out).outcome is Outcome.MODEL_MISMATCH
    assert last(out).words.startswith(f"scans come at {hz:g} Hz, the calibration is of 100 Hz: ")


def test_back_at_its_rate_it_is_judged_anew() -> None:
    turn = 400
    slow_ns = [stands.START_NS + k * PERIOD_NS * 5 // 4 for k in range(turn)]
    scans = [
        replace(scan, stamp_ns=slow_ns[k] if k < turn else slow_ns[-1] + (k - turn + 1) * PERIOD_NS)
        for k, scan in enumerate(healthy())
    ]
    out = stands.replay(stands.pipeline(), [stands.table(), *scans])
    outcomes = [group.outcome for group in stands.of(AmbiguityGroup, out)]
    assert Outcome.MODEL_MISMATCH in outcomes
    assert outcomes[-1] is Outcome.NOMINAL
    assert stands.of(Detection, out) == []
