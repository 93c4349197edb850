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

"""Moments of a block by both backends, against scipy in double precision."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from flea_diag.core import backend
from flea_diag.core.vibration.block_moments import moments_loop, moments_numpy

COMPILED = backend.compiled(moments_loop) if backend.chosen("auto") == "numba" else moments_loop


@pytest.mark.parametrize("moments", [moments_numpy, moments_loop, COMPILED])
@pytest.mark.parametrize(("count", "stride"), [(2000, 4), (1999, 3), (2, 1)])
def test_they_are_those_of_the_points_used(moments, count: int, stride: int) -> None:
    fields = np.random.default_rng(5).standard_normal((count, 4)).astype(np.float32)
    fields[:, 0] = np.arange(count)  # the time has no part in it
    fields[:, 2] = 4.0 * fields[:, 2] ** 3 + 9.81
    fields[:, 3] = 9.81  # a dead axis that still has its offset
    fields.setflags(write=False)
    std, kurtosis = moments(fields.ravel(), 3, stride)
    points = fields[::stride, 1:].astype(float)
    np.testing.assert_allclose(std[:2], points[:, :2].std(axis=0), rtol=1e-4)
    np.testing.assert_allclose(kurtosis[:2], stats.kurtosis(points[:, :2], fisher=False), rtol=1e-4)
    assert std[2] < 1e-5
