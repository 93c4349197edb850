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

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.observed import FLEA_COUNTS

from flea_diag.core.sensors.plausibility import (
    CLEAN_S,
    ENTER_S,
    VoltagePlausibility,
    usable,
)

LIMIT_V = 8.0
ENTER_SAMPLES, CLEAN_SAMPLES = map(FLEA_COUNTS.of, (ENTER_S, CLEAN_S))


def test_a_bad_stretch_is_left_at_once_and_trusted_again_late():
    residual = np.zeros(4000)
    residual[500:600] = -24.0
    use = usable(residual, LIMIT_V, counts=FLEA_COUNTS)
    assert use[:500].all()
    assert not use[500 : 600 + CLEAN_SAMPLES - 1].any()
    assert use[600 + CLEAN_SAMPLES :].all()


def test_short_disagreements_lose_only_themselves():
    residual = np.zeros(3000)
    for start in range(100, 2900, 100):
        residual[start : start + ENTER_SAMPLES - 1] = 24.0
    use = usable(residual, LIMIT_V, counts=FLEA_COUNTS)
    np.testing.assert_array_equal(use, residual == 0.0)


def test_a_channel_bad_from_the_start_is_never_trusted():
    check = VoltagePlausibility(LIMIT_V, counts=FLEA_COUNTS)
    assert [check.step(20.0) for _ in range(ENTER_SAMPLES)] == [False] * ENTER_SAMPLES
    assert check.bad


def test_no_residual_tells_nothing():
    check = VoltagePlausibility(LIMIT_V, counts=FLEA_COUNTS)
    assert check.step(math.nan)
    for _ in range(ENTER_SAMPLES):
        check.step(9.0)
    assert not check.step(math.nan)
    assert check.bad


@given(st.lists(st.floats(-7.9, 7.9), max_size=300))
def test_what_agrees_is_always_used(residual):
    assert usable(np.array(residual), LIMIT_V, counts=FLEA_COUNTS).all()


@given(st.lists(st.sampled_from((0.0, 30.0, math.nan)), max_size=300))
def test_what_disagrees_is_never_used(residual):
    values = np.array(residual)
    assert not usable(values, LIMIT_V, counts=FLEA_COUNTS)[np.abs(values) > LIMIT_V].any()
