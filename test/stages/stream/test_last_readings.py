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

from flea_diag.stages.stream.last_readings import LastReadings

NAN = float("nan")
ROWS = np.array([[NAN, 1.0], [2.0, NAN], [NAN, NAN], [NAN, NAN], [NAN, 5.0], [NAN, 6.0]])
HELD = np.array([[NAN, 1.0], [2.0, 1.0], [2.0, 1.0], [2.0, NAN], [NAN, 5.0], [NAN, 6.0]])


def test_a_reading_is_held_for_so_many_scans():
    np.testing.assert_array_equal(LastReadings(2, 2).step(ROWS), HELD)


def test_scans_in_blocks_are_those_one_by_one():
    one = LastReadings(2, 2)
    np.testing.assert_array_equal(np.concatenate([one.step(row[None]) for row in ROWS]), HELD)
    some = LastReadings(2, 2)
    parts = [some.step(part) for part in np.split(ROWS, [1, 4])]
    np.testing.assert_array_equal(np.concatenate(parts), HELD)


def test_nothing_is_held_over_an_interruption():
    last = LastReadings(2, 2)
    last.step(np.array([[1.0, 2.0]]))
    last.interrupt()
    assert np.isnan(last.step(np.array([[NAN, 3.0]]))).tolist() == [[True, False]]
