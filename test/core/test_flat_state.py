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

"""Tables in flat arrays are found by name and by place, and copies are independent."""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from flea_diag.core.flat_state import FlatState, counts_of, numbers_of
from flea_diag.core.state_copy import state_copy

SHAPES = (2, 3), (4,), (2, 2, 2)


def state() -> FlatState:
    numbers = {f"n{k}": np.full(shape, k + 0.5) for k, shape in enumerate(SHAPES)}
    return FlatState(numbers, {"none": [], "one": True, "two": [[1, 2], [3, 4]]})


def test_loops_see_what_is_written_by_name() -> None:
    held = state()
    for place, shape in enumerate(SHAPES):
        held.table[f"n{place}"][...] = np.arange(np.prod(shape)).reshape(shape)
        rows = 1 if len(shape) == 1 else shape[0]
        found = numbers_of(held.flat, place)
        assert found.tolist() == np.arange(np.prod(shape)).reshape(rows, -1).tolist()
    assert [counts_of(held.flat, k).tolist() for k in (3, 4, 5)] == [[[]], [[1]], [[1, 2], [3, 4]]]


def test_what_loops_write_is_seen_by_name() -> None:
    held = state()
    numbers_of(held.flat, 2)[1, 3] = -1.0
    counts_of(held.flat, 4)[0, 0] = 7
    assert held.table["n2"][1, 1, 1] == -1.0
    assert held.table["one"].item() == 7


def test_a_copy_has_arrays_of_its_own() -> None:
    held = state()
    for made in (deepcopy(held), state_copy([held])[0]):
        made.table["n1"][:] = 9.0
        counts_of(made.flat, 5)[0, 0] = 9
        assert numbers_of(made.flat, 1).tolist() == [[9.0] * 4]
        assert made.table["two"][0, 0] == 9
        assert held.table["n1"].tolist() == [1.5] * 4
        assert held.table["two"][0, 0] == 1
