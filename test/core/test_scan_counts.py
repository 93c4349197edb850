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

"""Times of the method as counts of scans: the same times at every rate."""

from __future__ import annotations

import pytest

from flea_diag.core.scan_counts import ScanCounts


@pytest.mark.parametrize(
    ("period_s", "second", "kernel"),
    [(0.04, 25, 9), (0.02, 50, 17), (0.01, 100, 31), (0.005, 200, 61), (0.001, 1000, 301)],
)
def test_a_second_and_the_kernel_are_as_long_at_every_rate(
    period_s: float, second: int, kernel: int
) -> None:
    counts = ScanCounts(period_s)
    assert (counts.of(1.0), counts.kernel) == (second, kernel)
    assert kernel * period_s == pytest.approx(0.31, abs=0.05)


def test_a_description_may_state_another_smoothing() -> None:
    assert (ScanCounts(0.04, 1.2).kernel, ScanCounts(0.04, 1.2).of(1.0)) == (31, 25)


def test_a_time_shorter_than_a_scan_is_one_scan_and_the_shortest_kernel_has_a_curvature() -> None:
    assert (ScanCounts(0.5).of(0.1), ScanCounts(0.5).kernel) == (1, 5)
