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

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.conditions.clipped import ClippedReadings
from flea_diag.core.residuals.residual_rows import ResidualRows

KNOWN = compiled_relations("actuator.yaml").residuals
LASTS = 5


def left(at_end: bool | np.ndarray, blocks: tuple[int, ...]) -> list[set[str]]:
    """Residuals void in each of 20 scans, of which the fourth has a load position of 0.1 m."""
    clipped = ClippedReadings(KNOWN, LASTS)
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
