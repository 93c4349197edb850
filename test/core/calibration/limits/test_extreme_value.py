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

"""The tail of maxima, against scipy's distributions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.calibration.limits.extreme_value import (
    LEAST_MAXIMA,
    extreme_value,
    l_moments,
    return_level,
)


def test_l_moments_of_a_uniform_distribution_are_a_half_a_sixth_and_none() -> None:
    found = l_moments(np.random.default_rng(1).uniform(size=200_000))
    assert found == pytest.approx((1 / 2, 1 / 6, 0.0), abs=3e-3)


@pytest.mark.parametrize("shape", [0.0, 0.15])
def test_the_level_of_rare_maxima_is_that_of_the_distribution_they_were_drawn_from(
    shape: float,
) -> None:
    from scipy import stats  # a second of every worker's time, were it imported with the tests

    whole = stats.genextreme(shape, loc=0.5, scale=0.1)
    drawn = whole.rvs(size=20_000, random_state=2)
    assert extreme_value(drawn)[2] == pytest.approx(shape, abs=0.02)
    assert return_level(drawn, 1e-3) == pytest.approx(whole.isf(1e-3), rel=0.03)


def test_a_heavier_tail_than_that_of_gumbel_is_not_read_from_maxima() -> None:
    from scipy import stats

    drawn = stats.genextreme(-0.3).rvs(size=20_000, random_state=3)
    assert extreme_value(drawn)[2] == 0.0


def test_a_few_maxima_show_no_tail() -> None:
    assert math.isnan(return_level(np.ones(LEAST_MAXIMA - 1), 1e-3))
