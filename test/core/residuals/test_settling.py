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

"""Residuals that hold only some time after motion has begun, ended or turned."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from support.models.stepper import DESCRIPTION

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.residual_set import residual_set
from flea_diag.core.residuals.settling import Settling, scans_of, scans_since_change, ways
from flea_diag.errors import ConfigurationError

HELD = tuple(DESCRIPTION["base_parameters"])[:-1]
WAY = np.array([0, 0, 0, 0, 1, 1, 1, 1, 1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 1, 0], dtype=np.int8)


def stepper(settles_s: float):
    content = copy.deepcopy(DESCRIPTION)
    content["residuals"]["parity_power"]["settles_s"] = settles_s
    model = actuator(content)
    return residual_set(model, relation_set(model, ["parity_power"], HELD, ("coulomb_friction_n",)))


def left(parts: list[np.ndarray]) -> list[bool]:
    """Where the balance has a value, in scans that come in these parts."""
    rows = stepper(0.08)
    settling = Settling(rows, 0.04, 3)
    found: list[bool] = []
    for way in parts:
        n = len(way)
        motion = np.column_stack([0.02 * way + 0.001, way])
        made = ResidualRows(
            np.ones((n, len(rows.rows))), np.empty(0), np.empty(0), motion, way != 0
        )
        settling.leave_out(made)
        found += np.isfinite(made.values[:, rows.place["parity_power"]]).tolist()
        others = np.delete(made.values, rows.place["parity_power"], axis=1)
        assert np.isfinite(others).all()
    return found


@pytest.mark.parametrize("cuts", [[], [1, 4, 10], list(range(1, len(WAY)))])
def test_a_balance_is_void_for_its_time_and_half_a_kernel_after_a_change(cuts: list[int]) -> None:
    # 0.08 s are two scans of 0.04 s, and half a kernel of three is one: three from the beginning,
    # the start, the reversal, the stop, the second start and the second stop on.
    void = {0, 1, 2, 4, 5, 6, 9, 10, 11, 13, 14, 15, 18, 19}
    assert left(np.split(WAY, cuts)) == [k not in void for k in range(len(WAY))]


def test_scans_are_counted_from_the_last_change() -> None:
    assert scans_since_change(WAY[2:7]).tolist() == [1, 2, 1, 2, 3]
    assert scans_since_change(WAY[2:7], 0, 4).tolist() == [5, 6, 1, 2, 3]
    assert scans_of(1.2, 0.04, 31) == 45
    assert scans_of(0.0, 0.04, 31) == 0


def test_the_way_is_the_sign_of_the_speed_in_motion() -> None:
    moving = np.array([True, True, False, False, True])
    assert ways(moving, np.array([0.2, -0.2, 0.2, np.nan, np.nan])).tolist() == [1, -1, 0, 0, 0]


@pytest.mark.parametrize("time", [-0.1, float("inf")])
def test_a_time_that_is_none_is_refused(time: float) -> None:
    with pytest.raises(ConfigurationError, match=r"settles_s = .* (must be|below its limit)"):
        stepper(time)
