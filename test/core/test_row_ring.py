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

from copy import deepcopy

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from flea_diag.core.row_ring import RowRing

WINDOWS = (2, 5)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 15), min_size=1, max_size=20))
def test_what_leaves_a_window_came_in_that_many_rows_before(lengths):
    ring = RowRing(1, WINDOWS, np.int64)
    assert ring.most == 15
    rows = np.arange(1, sum(lengths) + 1)[:, None]
    left = np.concatenate([ring.push(b) for b in np.split(rows, np.cumsum(lengths)[:-1])])
    for place, window in enumerate(WINDOWS):
        assert left[:, place, 0].tolist() == np.maximum(rows[:, 0] - window, 0).tolist()
    last = ring.last(5)[:, 0].tolist()
    assert last == np.maximum(np.arange(len(rows) - 4, len(rows) + 1), 0).tolist()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(1, 15), min_size=1, max_size=20))
def test_a_copy_goes_on_as_the_ring_does_with_what_windows_hold_alone(lengths):
    ring, rows = RowRing(1, WINDOWS, np.int64), np.arange(1, sum(lengths) + 1)[:, None]
    for block in np.split(rows, np.cumsum(lengths)[:-1]):
        copied = deepcopy(ring)
        assert copied.last(5).tolist() == ring.last(5).tolist()
        assert copied.place(0) == ring.size
        np.testing.assert_array_equal(copied.push(block), ring.push(block))
