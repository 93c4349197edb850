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

from flea_diag.core.sensors.stale_rows import StaleRows

NAN = float("nan")


@pytest.mark.parametrize("cuts", [(), (3,), (1, 2, 3, 4, 5, 6)])
def test_a_row_that_repeats_the_one_before_in_all_that_reads_is_stale(cuts: tuple[int, ...]):
    rows = np.array(
        [
            [1.0, 2.0, 3.0, NAN],
            [1.0, 2.0, 3.0, NAN],  # again
            [1.0, 2.0, 3.5, NAN],  # two sensors hold, one moves
            [1.0, 2.0, 3.5, 4.0],  # one more reads
            [1.0, 2.0, 3.5, 4.0],  # again
            [1.0, 2.0, NAN, NAN],
            [1.0, 2.0, NAN, NAN],  # two may agree by chance
        ]
    )
    stale = StaleRows(4)
    parts = [(part, stale.find(part)) for part in np.split(rows, cuts)]
    found = [np.zeros(len(part), bool) if flags is None else flags for part, flags in parts]
    assert np.flatnonzero(np.concatenate(found)).tolist() == [1, 4]
