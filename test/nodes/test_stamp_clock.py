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

"""Drift of the stamps of a source against the arrival of its messages."""

from __future__ import annotations

import random

import pytest

from flea_diag.nodes.stamp_clock import STRETCH_NS, StampClock

PERIOD_NS = 20_000_000
START_NS = 1_700_000_000 * 10**9


def heard(ppm: float, seconds: float, set_at_s: float = 1e9, set_by_ns: int = 0) -> StampClock:
    """Messages of a source whose clock is slow, each late by 0.2 ms or, now and then, much more."""
    clock, draw = StampClock(), random.Random(4)
    for number in range(round(1e9 * seconds / PERIOD_NS)):
        true_ns = number * PERIOD_NS
        stamp_ns = START_NS + round(true_ns * (1.0 - 1e-6 * ppm))
        stamp_ns += set_by_ns if true_ns > 1e9 * set_at_s else 0
        late_ns = draw.randrange(200_000, 300_000) + draw.choice((0, 0, 0, 50_000_000))
        clock.arrived(stamp_ns, true_ns + late_ns)
    return clock


@pytest.mark.parametrize("ppm", [0.0, 40.0, -1500.0])
def test_the_drift_is_that_of_the_clocks_whatever_the_delays(ppm: float) -> None:
    assert heard(ppm, 60.0).drift_ppm == pytest.approx(ppm, abs=5.0)


def test_nothing_is_said_of_half_a_minute() -> None:
    drift_ppm = heard(100.0, 1.9e-9 * STRETCH_NS).drift_ppm
    assert drift_ppm != drift_ppm


def test_a_clock_that_is_set_is_no_drift() -> None:
    """What was before it is forgotten."""
    assert heard(40.0, 90.0, 35.0, -1_000_000_000).drift_ppm == pytest.approx(40.0, abs=5.0)
