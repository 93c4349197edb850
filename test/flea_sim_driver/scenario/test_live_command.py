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

"""A value of the data bus: followed within limits, smooth, the same whatever the blocks."""

from __future__ import annotations

import math

import numpy as np

from flea_sim_driver.plant.plant import STEP_S
from flea_sim_driver.scenario.live_command import FOLLOWS_RAD_S, FollowedValue


def test_it_is_followed_at_the_speed_allowed_and_then_behind_a_lag() -> None:
    followed = FollowedValue(0.05, 0.0, 0.1, 0.12)
    np.testing.assert_allclose(followed.block(200), 0.05, rtol=1e-12)
    assert followed.take(0.08)
    path = np.concatenate([followed.block(200) for _ in range(10)])
    speed = np.diff(path, prepend=0.05) / STEP_S
    assert 0.11 < speed.max() <= 0.12 + 1e-9
    # A ramp behind a critically damped lag is late by 2 / omega.
    at = np.searchsorted(path, 0.065)
    assert abs(at * STEP_S - (0.015 / 0.12 + 2.0 / FOLLOWS_RAD_S)) < 0.01
    assert abs(path[-1] - 0.08) < 1e-4


def test_what_is_outside_or_no_number_is_refused_and_the_last_one_held() -> None:
    followed = FollowedValue(0.05, 0.0, 0.1, 0.12)
    assert not any(followed.take(value) for value in (math.nan, math.inf, -0.001, 0.1001))
    assert followed.refused == 4
    np.testing.assert_allclose(followed.block(400), 0.05, rtol=1e-12)


def test_blocks_of_any_length_give_one_path() -> None:
    paths = []
    for lengths in ((600,), (200, 200, 200), (1, 399, 200)):
        followed = FollowedValue(0.0, -1.0, 1.0, 2.0)
        followed.take(0.9)
        paths.append(np.concatenate([followed.block(n) for n in lengths]))
    np.testing.assert_allclose(paths[1], paths[0], atol=1e-12)
    np.testing.assert_allclose(paths[2], paths[0], atol=1e-12)
