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

"""What a clipped reading voids, and for how long."""

from __future__ import annotations

import numpy as np

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.conditions.bounding import Bounding
from flea_diag.core.conditions.clipped import ClippedReadings
from flea_diag.core.residual_values import ResidualRows

RELATIONS = compiled_relations("actuator.yaml")
KNOWN = RELATIONS.residuals
BOUNDING = Bounding(RELATIONS, learned(load_stand("flea")).parameters)
LASTS = 5


def left(at_end: bool | np.ndarray, blocks: tuple[int, ...]) -> list[set[str]]:
    """Residuals void in each of 20 scans, of which the fourth has a load position of 0.1 m."""
    clipped = ClippedReadings(KNOWN, LASTS, BOUNDING)
    clipped.use({"load_position": (0.0, 0.1), "motor_speed": (-800.0, 800.0)})
    readings = np.full((20, len(KNOWN.channels)), 0.05)
    readings[3, KNOWN.index["load_position"]] = 0.1
    found, start = [], 0
    for count in blocks:
        shape = count, len(KNOWN.rows)
        rows = ResidualRows(np.zeros(shape), *(np.zeros((count, 1)) for _ in range(4)))
        there = np.broadcast_to(at_end, 20)[start : start + count]
        clipped.step(readings[start : start + count], there)
        clipped.leave_out(rows)
        start += count
        found += [{KNOWN.rows[j].name for j in np.flatnonzero(np.isnan(v))} for v in rows.values]
    return found


def test_it_voids_what_needs_it_but_the_tests_of_the_sensor_itself() -> None:
    void = left(True, (20,))
    assert void[2] == set()
    assert "parity_kinematic" in void[3]
    assert not any(name.startswith("load_position") for name in void[3])
    assert "parity_electrical" not in void[3]
    assert [bool(each) for each in void] == [3 <= k < 3 + LASTS for k in range(20)]


def test_blocks_void_what_single_scans_do() -> None:
    assert left(True, (1,) * 20) == left(True, (20,)) == left(True, (4, 2, 14))


def test_away_from_the_ends_it_is_the_sensor_that_is_at_fault() -> None:
    assert not any(left(False, (20,)))


def test_in_a_runaway_it_is_not() -> None:
    away = np.arange(20) == 3
    assert left(away, (20,)) == left(True, (20,)) == left(away, (4, 2, 14))
    assert not any(left(~away, (20,)))


def void_with(readings: dict[str, float], values: dict[str, float]) -> set[str]:
    """Relations of the circuit that are void with some readings, of all that are as given."""
    clipped = ClippedReadings(KNOWN, LASTS, BOUNDING)
    limits = {"motor_voltage": 80.0, "motor_speed": 800.0, "motor_current": 50.0}
    clipped.use({name: (-limit, limit) for name, limit in limits.items()})
    rows = np.zeros((1, len(KNOWN.channels)))
    for name, value in readings.items():
        rows[0, KNOWN.index[name]] = value
    shape = 1, len(KNOWN.rows)
    residuals = ResidualRows(np.zeros(shape), *(np.zeros((1, 1)) for _ in range(4)))
    for name, value in values.items():
        residuals.values[0, KNOWN.place[name]] = value
    clipped.step(rows, True)
    clipped.leave_out(residuals)
    return {name for name in values if np.isnan(residuals.values[0, KNOWN.place[name]])}


def test_a_voltage_beyond_what_was_commanded_is_at_least_so_far_beyond() -> None:
    low = {"motor_voltage": -80.0}
    assert void_with(low, {"parity_drive": -30.0}) == set()
    assert void_with(low, {"parity_drive": 30.0}) == {"parity_drive"}
    assert void_with({"motor_voltage": 80.0}, {"parity_drive": 30.0}) == set()


def test_a_winding_that_is_open_misses_at_least_the_back_emf_that_was_read() -> None:
    fast = {"motor_speed": 800.0}
    missed = {"parity_electrical": -130.0, "parity_electrical_dn": -130.0}
    assert void_with(fast, missed) == set()
    assert void_with(fast, {name: -value for name, value in missed.items()}) == set(missed)


def test_readings_that_disagree_say_nothing() -> None:
    both = {"motor_voltage": -80.0, "motor_speed": -800.0}
    for value in (-5.0, 5.0):
        assert void_with(both, {"parity_electrical": value}) == {"parity_electrical"}
    assert void_with(both, {"parity_drive": -30.0}) == set()
