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

"""For how long the actuator has moved one way."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.detection.one_way import OneWay
from flea_diag.core.residual_values import ResidualRows

SPEEDS = (0.0, 5.0, 5.0, 0.0, 5.0, -5.0, -5.0, 0.1, 0.1, -5.0, 5.0)
MOVING = (0, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1)
"""It rests, goes out, rests, goes on, comes back, stands against a push, goes on, and turns."""


@pytest.mark.parametrize("cuts", [(), (1, 4, 8), tuple(range(1, 11))])
def test_rest_ends_no_motion_and_a_turn_or_a_push_does(cuts: tuple[int, ...]) -> None:
    speeds, moving = np.array(SPEEDS), np.array(MOVING, dtype=bool)
    motion = np.stack((speeds, np.where(np.abs(speeds) < 1.0, 1.0, np.sign(speeds))), axis=1)
    empty, one_way, found = np.empty((11, 0)), OneWay(1.0), []
    for rows in np.split(np.arange(11), cuts):
        found.append(
            one_way.step(ResidualRows(empty[rows], empty, empty, motion[rows], moving[rows]))
        )
    ways, lasted = np.concatenate(found, axis=1).tolist()
    assert ways == [0, 1, 1, 1, 1, -1, -1, 0, 0, -1, 1]
    assert lasted == [0, 1, 2, 2, 3, 1, 2, 0, 0, 1, 1]
