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

"""Time in motion of a run whose motion is known."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.tools.motion import moving_s
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Scan

SECOND_NS = 1_000_000_000
STAMPS = 10_000_000 * np.arange(1000)
# At rest, out at 50 mm/s from 3 s to 5 s, at rest again, with the noise of a potentiometer.
X = np.clip(0.05 * (STAMPS / 1e9 - 3.0), 0.0, 0.1) + np.random.default_rng(1).normal(0, 6e-5, 1000)
SCANS = [
    Scan(int(t), ("load_force", "actuator_position"), (0.0, float(x)))
    for t, x in zip(STAMPS, X, strict=True)
]


@pytest.mark.parametrize(
    ("from_s", "to_s", "expected"), [(0, 10, 2.0), (4, 10, 1.0), (0, 4, 1.0), (6, 9, 0.0)]
)
def test_only_motion_counts(from_s: int, to_s: int, expected: float) -> None:
    # A speed over 0.2 s blurs each end of a motion by less than a tenth.
    found = moving_s(SCANS, from_s * SECOND_NS, to_s * SECOND_NS)
    assert found == pytest.approx(expected, abs=0.2)


def test_blocks_say_the_same() -> None:
    values = np.column_stack((np.zeros(1000), X))
    block = ScanBlock(STAMPS, ("load_force", "actuator_position"), values)
    assert moving_s([block], 0, 10 * SECOND_NS) == moving_s(SCANS, 0, 10 * SECOND_NS)
    assert moving_s([], 0, SECOND_NS) == 0.0
