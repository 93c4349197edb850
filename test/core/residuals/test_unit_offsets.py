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

from __future__ import annotations

import numpy as np
import pytest
from support.observed import FLEA_TOLERANCE

from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.unit_difference import LEAST
from flea_diag.core.residuals.unit_offsets import OffsetLearning

K, R = 170.0, 3.1
TOLERANCE = FLEA_TOLERANCE


def learn(drag: float, seconds: float = 6.0, offset: float = 0.2, both_ways: bool = True):
    """Current offset off by so much, and a drag that the calibration does not know."""
    random, learning = np.random.default_rng(2), OffsetLearning("current_offset_a", TOLERANCE)
    for k in range(round(seconds * 100)):
        v = 0.03 if not both_ways or (k // 50) % 2 else -0.03
        sensitivity = np.zeros(len(UNIT_PARAMETERS))
        sensitivity[[0, 1, 6]] = -np.sign(v), -v, -K
        residual = K * offset + drag * np.sign(v) + 8.0 * random.standard_normal()
        learning.add(np.array([residual]), sensitivity[None], 8.0**2)
    return learning.offset()


@pytest.mark.parametrize("drag", [0.0, 60.0, 200.0])
def test_an_offset_is_learned_and_a_drag_is_not(drag):
    found, sigma = learn(drag)
    assert found == pytest.approx(0.2, abs=4 * sigma + 0.005)
    assert sigma < 0.01


def test_one_way_motion_cannot_part_offset_from_drag_and_says_so():
    found, sigma = learn(60.0, both_ways=False)
    _, prior = OffsetLearning("current_offset_a", TOLERANCE).offset()
    assert sigma > 0.9 * prior
    assert abs(found) < 0.15


def test_without_data_the_prior_stands():
    for name in ("current_offset_a", "voltage_offset_v"):
        found, sigma = OffsetLearning(name, TOLERANCE).offset()
        assert (found, sigma) == (0.0, pytest.approx(getattr(TOLERANCE, name)))


def test_it_agrees_with_least_squares_with_the_prior_as_rows():
    random = np.random.default_rng(4)
    learning = OffsetLearning("voltage_offset_v", TOLERANCE)
    sensitivity = random.standard_normal((40, len(UNIT_PARAMETERS)))
    residual = random.standard_normal(40)
    learning.add(residual, sensitivity, 0.25)
    wide = np.array(
        [
            300.0,
            3750.0,
            450.0,
            9.0,
            120.0,
            TOLERANCE.voltage_offset_v,
            0.15,
            *[LEAST] * (len(UNIT_PARAMETERS) - 7),
        ]
    )
    A = np.vstack((sensitivity / 0.5, np.diag(1 / wide)))
    x = np.linalg.lstsq(A, np.concatenate((-residual / 0.5, np.zeros(len(wide)))), rcond=None)[0]
    found, sigma = learning.offset()
    at = UNIT_PARAMETERS.index("voltage_offset_v")
    assert found == pytest.approx(x[at], rel=1e-6)
    assert sigma == pytest.approx(np.linalg.inv(A.T @ A)[at, at] ** 0.5, rel=1e-6)


def test_what_is_not_a_number_is_no_evidence():
    learning = OffsetLearning("current_offset_a", TOLERANCE)
    learning.add(np.array([np.nan]), np.ones((1, len(UNIT_PARAMETERS))), 1.0)
    learning.add(np.ones(1), np.full((1, len(UNIT_PARAMETERS)), np.nan), 1.0)
    assert learning.offset() == OffsetLearning("current_offset_a", TOLERANCE).offset()
