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

"""Signs of relations since an onset, and the stamps of windows."""

from __future__ import annotations

import numpy as np

from flea_diag.core.evidence.fault_evidence import KEPT_WINDOWS
from flea_diag.stages.evidence.signs import signs
from flea_diag.stages.evidence.window_stamps import WindowStamps


def of(errors: list[float]) -> str:
    """Sign of one relation with these errors."""
    each = np.array(errors)
    (sign,) = signs(
        np.array([float(len(each))]), np.array([each.sum()]), np.array([(each**2).sum()])
    )
    return sign


def test_a_relation_that_deviates_has_a_sign() -> None:
    assert of([2.0] * 9) == "+"
    assert of([-9.0]) == "-"


def test_one_that_alternates_deviates_without_one() -> None:
    assert of([6.0, -6.0] * 4) == "*"


def test_noise_has_none() -> None:
    assert of([1.0, -1.2, 0.4, 0.9, -0.3]) == ""
    assert of([]) == ""


def test_windows_are_found_by_the_stamps_before_them() -> None:
    stamps = WindowStamps()
    for number in range(5):
        stamps.add(100 * (number + 1))
    assert [stamps.before(number) for number in range(6)] == [0, 100, 200, 300, 400, 500]
    assert all(stamps.number(stamps.before(number)) == number for number in range(6))


def test_what_is_no_longer_kept_begins_with_the_first_that_is() -> None:
    stamps = WindowStamps()
    for number in range(KEPT_WINDOWS + 10):
        stamps.add(number + 1)
    assert stamps.before(3) == 0
    assert stamps.number(0) == 10
    assert stamps.number(stamps.before(20)) == 20
