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

"""Columns of the law: what the relations of shipped stands neglect."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.core.run_law.law_columns import NEGLECTED, law_columns
from flea_diag.core.run_law.run_windows import CURRENT_ZERO, FORMED, current_side, left_out


@pytest.mark.parametrize(("name", "side"), [("ema", True), ("wing", False), ("flea", False)])
def test_a_bridge_has_a_resistance_and_follows_the_zero_of_the_current_where_it_is_named(
    name: str, side: bool
) -> None:
    stand = load_stand(name)
    calibration = learned(stand)
    known = effects(stand, calibration)
    assert bool(current_side(known)) == side
    differences = known.differences
    tolerance = dict(zip(differences, calibration.differences(differences), strict=True))
    columns = law_columns(known, calibration.parameters, tolerance, ("parity_drive",))
    own = {c.name.split(": ")[1] for c in columns.columns if c.kind == NEGLECTED}
    assert "motor_current" in own
    assert (CURRENT_ZERO in own) == side


def test_an_error_of_the_zero_of_the_current_acts_by_the_slope_of_its_smooth_sign() -> None:
    current, none, width, error = np.linspace(-1.0, 1.0, 201), np.zeros(201), 0.15, 1e-6
    side, off = np.tanh(current / width), np.tanh((current + error) / width)
    slope = left_out(current, none, none, none, none, none, side)[:, FORMED.index(CURRENT_ZERO)]
    np.testing.assert_allclose(slope, (off - side) * width / error, atol=1e-4)
    plain = left_out(current, none, none, none, none, none)
    assert not plain[:, FORMED.index(CURRENT_ZERO)].any()
