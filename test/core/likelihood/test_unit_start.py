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

"""Which unit has started: two relations, r = s . (theta - theta of the unit), with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.observed import FLEA_TOLERANCE, flea_parameters

from flea_diag.core.likelihood.unit_start import UnitStart, estimate, unit_start
from flea_diag.core.residuals.parameters import (
    UNIT_PARAMETERS,
    UnitSpread,
)
from flea_diag.core.residuals.unit_offsets import OffsetLearning

PARAMETERS = flea_parameters(winding_resistance_ohm=3.0)
TOLERANCE = replace(FLEA_TOLERANCE, force_constant_n_per_a=4.0)
CALIBRATED = UnitSpread(1, {"winding_resistance_ohm": 0.02, "force_constant_n_per_a": 0.5})
RESISTANCE = UNIT_PARAMETERS.index("winding_resistance_ohm")
FORCE = UNIT_PARAMETERS.index("force_constant_n_per_a")
SIGMA = 0.3


def started(resistance: float, force: float, offset: float = 0.0, scans: int = 500) -> UnitStart:
    """A unit with so much more resistance and force constant, and another zero of the voltage."""
    draw, learning = np.random.default_rng(2), []
    for parameter, change in ((RESISTANCE, resistance), (FORCE, force)):
        s = np.zeros((scans, len(UNIT_PARAMETERS)))
        s[:, parameter] = 2.0 * np.sin(0.05 * np.arange(scans))
        s[:, UNIT_PARAMETERS.index("voltage_offset_v")] = float(parameter == RESISTANCE)
        r = SIGMA * draw.standard_normal(scans) - s[:, parameter] * change
        r -= s[:, UNIT_PARAMETERS.index("voltage_offset_v")] * offset
        learning.append(OffsetLearning("voltage_offset_v", TOLERANCE))
        learning[-1].add(r, s, SIGMA**2)
    return unit_start(estimate(learning, TOLERANCE), PARAMETERS, TOLERANCE, CALIBRATED)


def test_the_unit_of_the_calibration_is_no_other() -> None:
    assert started(0.0, 0.0) == UnitStart()
    assert started(0.0, 0.0, offset=2.0).words == ""  # zeros differ from day to day


def test_another_unit_is_learned_with_what_differs_and_by_how_much() -> None:
    found = started(0.3, 0.0)
    (only,) = found.differences
    assert only.parameter == "winding_resistance_ohm"
    assert only.change == pytest.approx(0.3, abs=4 * only.sigma)
    assert only.sigma == pytest.approx(SIGMA / np.sqrt(2.0 * 500), rel=0.05)
    assert found.learned is not None
    assert found.learned["winding_resistance_ohm"] == (only.change, only.sigma)
    assert "coulomb_friction_n" not in found.learned  # nothing has shown it
    assert not found.is_beyond
    assert found.words == (
        "another unit than calibrated: winding_resistance_ohm +0.307 (+10.2%); "
        "learned as its baseline"
    )


def test_what_no_healthy_unit_differs_by_is_beyond_and_comes_first() -> None:
    found = started(0.3, 20.0)
    assert [each.parameter for each in found.differences] == [
        "force_constant_n_per_a",
        "winding_resistance_ohm",
    ]
    assert found.is_beyond
    assert found.words.endswith("beyond what healthy units of this design differ by")


def test_too_little_motion_is_no_evidence() -> None:
    assert started(0.3, 20.0, scans=1) == UnitStart()


def test_a_calibration_that_knows_no_unit_calls_none_another() -> None:
    nothing = estimate((), TOLERANCE)
    assert unit_start(nothing, PARAMETERS, TOLERANCE, CALIBRATED) == UnitStart()
    other = np.full(len(UNIT_PARAMETERS), 1e3), np.ones(len(UNIT_PARAMETERS))
    assert unit_start(other, PARAMETERS, TOLERANCE, CALIBRATED).is_beyond
    assert unit_start(other, PARAMETERS, TOLERANCE, None) == UnitStart()
