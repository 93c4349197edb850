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

"""Limit checks: learned from extremes, tripped after three scans, latched."""

from __future__ import annotations

import math
from functools import cache

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.baselines.limit_check import LimitCheckStage, learned_limits
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Record, Scan

LIMITS = {"motor_current": (-2.0, 4.0), "motor_temperature": (10.0, 60.0)}


@cache
def faults() -> tuple[str, ...]:
    return knowledge(load_stand(), learned(load_stand())).faults


def scan(k: int, current: float, temperature: float = 20.0) -> Scan:
    return Scan(k * 10_000_000, ("motor_current", "motor_temperature"), (current, temperature))


def run(currents: list[float]) -> list[Record]:
    stage = LimitCheckStage(LIMITS, faults())
    return [out for k, value in enumerate(currents, 1) for out in stage.handle(scan(k, value))]


def test_limits_are_the_extremes_and_a_tenth_of_their_span() -> None:
    learned = learned_limits([scan(1, 1.0), scan(2, -3.0), scan(3, math.nan), scan(4, 7.0)])
    assert learned["motor_current"] == pytest.approx((-4.0, 8.0))
    assert learned["motor_temperature"] == pytest.approx((20.0, 20.0))


def test_within_the_limits_it_says_nominal_once() -> None:
    (said,) = run([0.0, 4.0, -2.0, math.nan, 0.0])
    assert isinstance(said, AmbiguityGroup)
    assert said.outcome is Outcome.NOMINAL


def test_spikes_shorter_than_three_scans_pass() -> None:
    assert len(run([5.0, 5.0, 0.0, 5.0, 5.0, 0.0])) == 1


def test_the_third_scan_beyond_trips_and_latches() -> None:
    said = run([0.0, -2.5, -2.5, -2.5, -9.0, 0.0])
    assert [type(each) for each in said] == [AmbiguityGroup, Detection, AmbiguityGroup]
    detection, group = said[1], said[2]
    assert isinstance(detection, Detection)
    assert isinstance(group, AmbiguityGroup)
    assert (detection.stamp_ns, detection.z, detection.threshold) == (40_000_000, -2.5, -2.0)
    assert group.detected_stamp_ns == 40_000_000


def test_the_group_is_the_sensor_of_the_channel_and_the_plant() -> None:
    members = {each.fault for each in run([5.0] * 3)[-1].members}  # type: ignore[attr-defined]
    assert {"motor_current_bias", "motor_current_dead", "jam", "winding_short"} <= members
    assert not members & {"motor_temperature_bias", "accelerometer_2_fault"}
