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

"""What healthy units differ by: stated, measured from three units on, and both joined."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.observed import FLEA_TOLERANCE, flea_parameters

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.run_spread import are_one, joined, measured_spread, tolerance_of
from flea_diag.core.residuals.parameters import UnitSpread

RESISTANCE = "winding_resistance_ohm"
STATED = replace(FLEA_TOLERANCE, winding_resistance_ohm=0.3)


def test_the_spread_of_units_is_found_beside_the_errors_of_their_values() -> None:
    draw = np.random.default_rng(3)
    found = []
    for _ in range(400):
        values = 3.0 + 0.2 * draw.standard_normal(3) + 0.1 * draw.standard_normal(3)
        units = [{RESISTANCE: (value, 0.1)} for value in values]
        found.append(measured_spread(units, STATED).spread[RESISTANCE] ** 2)
    # Held at 0 where the errors exceed it, so a little more than 0.2 squared on average.
    assert 0.04 <= np.mean(found) < 0.05


def test_two_units_say_nothing_of_the_spread() -> None:
    assert measured_spread([{RESISTANCE: (3.0, 0.0)}, {RESISTANCE: (3.2, 0.0)}], STATED) == (
        UnitSpread()
    )


@pytest.mark.parametrize("last", [{RESISTANCE: (3.1, 1.0)}, {}])
def test_what_a_unit_does_not_fix_by_itself_is_left_as_stated(last) -> None:
    known = {RESISTANCE: (3.0, 0.01)}
    measured = measured_spread([known, known, last], STATED)
    assert RESISTANCE not in measured.spread
    assert joined(STATED, measured) == STATED


def test_three_units_count_as_much_as_the_statement_and_more_units_more() -> None:
    three, nine = (
        joined(STATED, UnitSpread(count, {RESISTANCE: 0.1})).winding_resistance_ohm
        for count in (3, 9)
    )
    assert three == pytest.approx(math.sqrt((0.3**2 + 0.1**2) / 2))
    assert nine == pytest.approx(math.sqrt((2 * 0.3**2 + 8 * 0.1**2) / 10))


def test_units_are_alike_in_the_force_constant_unless_the_description_says_more() -> None:
    parameters = flea_parameters(force_constant_n_per_a=400.0)
    flea, ema = (compiled_relations(name) for name in ("actuator.yaml", EMA))
    assert tolerance_of(parameters, flea).force_constant_n_per_a == 0.0
    assert tolerance_of(parameters, ema).force_constant_n_per_a == 10.0  # 2.5 %
    assert "parity_drive" not in flea.differing
    assert "parity_drive" in ema.differing


EMA = "config/stands/ema/actuator.yaml"


@pytest.mark.parametrize(("apart", "one"), [(0.05, True), (0.2, False)])
def test_three_serial_numbers_of_one_unit_are_seen_by_their_likeness(
    apart: float, one: bool
) -> None:
    spread = {RESISTANCE: apart, "back_emf_v_s_per_m": 0.1, "voltage_offset_v": 0.5}
    assert are_one(UnitSpread(3, spread), STATED) is one
    assert not are_one(UnitSpread(), STATED)
