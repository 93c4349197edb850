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

"""Sensor tests on a stream of which scans may be missing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support import stands
from support.observer_scans import after, counters, healthy

from flea_diag.configuration.description import compiled_relations
from flea_diag.stages.observer.sensor_validation import SensorValidation
from flea_diag.wire.records import Residual

FLEA = compiled_relations("actuator.yaml").residuals


@pytest.mark.slow
def test_a_sensor_that_holds_its_reading_is_counted_as_stuck():
    at = healthy()[0].channels.index("load_force")
    held = healthy()[1000].values[at]
    stuck = [after(s, load_force=held) if k > 1000 else s for k, s in enumerate(healthy())]
    stage = stands.observer()
    stands.replay(stage, [stands.table(), *stuck])
    least = next(row.repeats for row in stands.calibration().sensors if row.channel == "load_force")
    assert counters(stage, stuck[-1], "load_force")["stuck"] == 999 - least + 1
    assert counters(stage, stuck[-1], "motor_current")["stuck"] == 0
    assert counters(stage, stuck[-1], "load_force")["stale"] == 0


def position_steps(missing: range) -> np.ndarray:
    """Statistic of the position where a ramp of 1 mm per scan lacks these scans."""
    rows = np.full((60, len(FLEA.channels)), np.nan)
    rows[:, FLEA.channels.index("actuator_position")] = 0.001 * np.arange(60)
    kept = np.array([k for k in range(60) if k not in missing])
    tests = SensorValidation(FLEA, stands.calibration(), "auto")
    stamps_ns = stands.START_NS + stands.PERIOD_NS * kept
    before_ns = stands.START_NS - stands.PERIOD_NS
    _, z = tests.step(before_ns, stamps_ns, rows[kept])
    return z[:, FLEA.sensors.names.index("actuator_position")]


def test_missing_scans_are_no_step_of_a_motion():
    whole, across = position_steps(range(0)), position_steps(range(30, 35))
    assert np.nanmax(np.abs(whole)) < 1.0
    # Readings on either side of the loss are told apart by their times.
    assert np.nanmax(np.abs(across)) < 1.0
    assert np.isfinite(across[np.isfinite(whole).argmax() :]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("is_held", "judged"), [(True, False), (False, True)])
def test_what_was_taken_before_a_reading_was_told_as_held_ends_with_it(is_held, judged):
    """A drop-out was a deviation of the temperature: its mean held the readings till then."""
    name, begin = "motor_temperature", 1200
    limits = stands.calibration()
    least = next(row.repeats for row in limits.sensors if row.channel == name)
    end = begin + least + 2
    reading = healthy()[begin].values[healthy()[0].channels.index(name)] if is_held else math.nan
    spoilt = [after(s, **{name: reading}) if begin <= k < end else s
              for k, s in enumerate(healthy()[: end + 200])]  # fmt: skip
    told = stands.of(Residual, stands.replay(stands.observer(), [stands.table(), *spoilt]))
    z = np.array([row.z[row.names.index(name)] for row in told])
    window = min(w.window for w in limits.limit(name).windows)
    assert np.isfinite(z[begin - 1])
    assert np.isfinite(z[end : end + window - 1]).any() == judged
    assert np.isfinite(z[end + window :]).all()
