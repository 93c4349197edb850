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

"""Logarithms of the normal distribution, against those of scipy."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from flea_diag.core.evidence.normal_tail import FAR, log_below


def test_log_below_is_scipys_from_end_to_end() -> None:
    values = np.concatenate([np.linspace(-60.0, 40.0, 4001), [-1e6, -1e3, 1e3, 0.0, -0.0]])
    around = np.nextafter([FAR, FAR, 0.0, 0.0], [-99.0, 99.0, -99.0, 99.0])
    for each in (values, around):
        np.testing.assert_allclose(log_below(each), log_ndtr(each), rtol=1e-13, atol=1e-300)


def test_log_below_of_what_has_no_bound_and_of_nothing() -> None:
    values = np.array([[np.inf, -np.inf], [np.nan, 0.0]])
    np.testing.assert_array_equal(log_below(values), [[0.0, -np.inf], [np.nan, np.log(0.5)]])
    assert log_below(np.empty((0, 3))).shape == (0, 3)
