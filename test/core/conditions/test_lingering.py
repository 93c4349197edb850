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

"""Evidence of one scan counts for as long as a kernel holds it."""

from __future__ import annotations

import numpy as np

from flea_diag.core.conditions.lingering import Lingering


def test_it_lasts_for_its_scans_and_is_renewed() -> None:
    seen = np.array([0, 1, 0, 0, 0, 1, 1, 0, 0, 0], dtype=bool)
    found = Lingering(3).step(seen)
    assert found is not None
    assert found.tolist() == [0, 1, 1, 1, 0, 1, 1, 1, 1, 0]


def test_scans_and_blocks_give_the_same() -> None:
    seen = np.random.default_rng(1).random(200) < 0.05
    one, other = Lingering(7), Lingering(7)
    whole = one.step(seen)
    singly = [other.step(seen[k : k + 1]) for k in range(len(seen))]
    assert whole is not None
    assert whole.tolist() == [step is not None and bool(step[0]) for step in singly]


def test_nothing_is_said_where_nothing_is_seen() -> None:
    assert Lingering(3).step(np.zeros(5, dtype=bool)) is None
