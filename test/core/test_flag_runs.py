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

from itertools import groupby

import numpy as np
import pytest

from flea_diag.core.flag_runs import flag_runs, longest_run


@pytest.mark.parametrize("text", ["", ".", "#", "##..#", ".###.##", "#.#.#", "....", "####"])
def test_runs_are_those_of_a_walk_from_scan_to_scan(text: str) -> None:
    flags = np.array([letter == "#" for letter in text], dtype=bool)
    expected, at = [], 0
    for letter, run in groupby(text):
        count = len(list(run))
        expected += [[at, at + count]] if letter == "#" else []
        at += count
    assert flag_runs(flags).tolist() == expected
    assert longest_run(flags) == max((end - start for start, end in expected), default=0)
