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

"""Traces of runs: extremes of stretches, in bounded memory, and what is kept beside them."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.tools.campaign.envelope import FIRST_STRETCH_S, MOST_STRETCHES, Envelope
from flea_diag.tools.campaign.run_trace import RunTrace, read_trace, trace_path, write_trace
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelInfo,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Outcome,
    Residual,
    Scan,
    Truth,
)

S = 1_000_000_000


def group(at_s: int, outcome: Outcome, seq: int = 0) -> AmbiguityGroup:
    return AmbiguityGroup(at_s * S, outcome, 0, 0, seq, (), (), -1, "words", "", "replay")


def test_a_spike_of_one_sample_survives_any_length() -> None:
    envelope = Envelope(1)
    for k in range(20_000):
        envelope.add(k * 0.1, [7.0 if k == 1234 else 0.0])
    low, high = envelope.extremes(0)
    assert len(high) <= MOST_STRETCHES
    assert envelope.stretch_s * len(high) >= 2000.0
    assert [v for v in high if v] == [7.0]
    assert high.index(7.0) == int(123.4 / envelope.stretch_s)
    assert set(low) == {0.0}


@given(st.lists(st.tuples(st.floats(0.0, 1e5), st.floats(-1e6, 1e6)), min_size=1, max_size=60))
def test_extremes_are_those_of_the_samples(samples: list[tuple[float, float]]) -> None:
    envelope = Envelope(1)
    for time_s, value in samples:
        envelope.add(time_s, [value])
    low, high = envelope.extremes(0)
    assert min(v for v in low if v is not None) == pytest.approx(
        min(v for _, v in samples), rel=1e-4
    )
    assert max(v for v in high if v is not None) == pytest.approx(
        max(v for _, v in samples), rel=1e-4
    )


def test_nan_leaves_a_hole_and_the_other_column_alone() -> None:
    envelope = Envelope(2)
    envelope.add(0.0, [math.nan, 1.0])
    envelope.add(FIRST_STRETCH_S * 2.5, [3.0, math.nan])
    assert envelope.extremes(0) == ([None, None, 3.0], [None, None, 3.0])
    assert envelope.extremes(1) == ([1.0, None, None], [1.0, None, None])


def test_a_run_as_plain_data() -> None:
    trace = RunTrace()
    trace.add(ChannelTable(0, "stand", (ChannelInfo("motor_current", "A", -20.0, 20.0, 100.0),)))
    trace.add(Scan(10 * S, ("motor_current",), (1.5,)))
    trace.add(Residual(10 * S, ("parity", "blind"), (0.2, 0.1), (6.0, 1.0), (3.0, math.nan)))
    trace.add(group(10, Outcome.NOMINAL))
    trace.add(group(11, Outcome.NOMINAL, seq=1))
    trace.add(group(12, Outcome.UNEXPLAINED))
    trace.add(FeatureRequest(13 * S, 1, 2, "crest", 12 * S, 13 * S))
    trace.add(
        FeatureValue(13 * S, 1, 2, "crest", 12 * S, 13 * S, math.nan, "1", "?", 1, 2, "gap", 0)
    )
    trace.add(Truth(10 * S, "jam", 18 * S))
    told = json.loads(json.dumps(trace.to_mapping(), allow_nan=False))
    assert told["traces"]["motor_current"]["high"] == [1.5]
    assert told["traces"]["motor_current"]["unit"] == "A"
    assert told["traces"]["parity/limit"]["high"] == [2.0]
    assert told["traces"]["blind/limit"]["high"] == [None]
    assert [(each["at_s"], each["outcome"]) for each in told["groups"]] == [
        (0.0, "NOMINAL"),
        (2.0, "UNEXPLAINED"),
    ]
    assert (
        told["features"][0] | {"value": None, "reason": "gap", "asked_s": 3.0}
        == (told["features"][0])
    )
    assert told["truth"] == [["jam", 8.0]]


def test_an_estimate_is_kept_as_its_band_of_two_standard_deviations() -> None:
    trace = RunTrace()
    estimated = {"estimated": ("motor_current",), "estimates": (1.0,), "estimate_sigmas": (0.25,)}
    trace.add(Residual(10 * S, ("parity",), (0.2,), (6.0,), (3.0,), **estimated))  # type: ignore[arg-type]
    estimated["estimates"] = (1.1,)
    trace.add(Residual(10 * S + 1, ("parity",), (0.2,), (6.0,), (3.0,), **estimated))  # type: ignore[arg-type]
    band = trace.to_mapping()["traces"]["motor_current/band"]
    assert (band["low"], band["high"]) == ([0.5], [1.6])


def test_a_trace_is_read_back_and_what_is_none_is_not_drawn(tmp_path: Path) -> None:
    trace = RunTrace()
    trace.add(Scan(10 * S, ("motor_current",), (1.5,)))
    detail = tmp_path / "run.json"
    assert read_trace(detail) is None
    write_trace(detail, trace)
    assert read_trace(detail) == trace.to_mapping()
    packed = trace_path(detail).read_bytes()
    for broken in (b"", packed[: len(packed) // 2], b"not packed", gzip.compress(b"[1, 2]")):
        trace_path(detail).write_bytes(broken)
        assert read_trace(detail) is None


def test_blocks_draw_what_their_records_draw() -> None:
    values = np.arange(6.0).reshape(3, 2)
    block = ScanBlock(S * np.array([10, 11, 13]), ("motor_current", "load_force"), values)
    single, whole = RunTrace(), RunTrace()
    for scan in block.records():
        single.add(scan)
    whole.add(block)
    assert single.to_mapping() == whole.to_mapping()
    assert whole.to_mapping()["traces"]["load_force"]["high"][-1] == 5.0
