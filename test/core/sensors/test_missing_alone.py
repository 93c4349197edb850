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

"""A sensor that was not read in a part of one nominal recording: the others show that it should."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.sensors.missing_alone import missing_alone

PERIOD_S = 0.01


def recordings(gaps: dict[int, int], of: str = "load_force") -> list[dict[str, np.ndarray]]:
    """Five of 20 s; so many scans of these have no reading of one channel."""
    found = [{name: np.ones(2000) for name in ("load_force", "motor_current")} for _ in range(5)]
    for number, scans in gaps.items():
        found[number][of][:scans] = np.nan
    return found


@pytest.mark.parametrize(
    ("gaps", "named"),
    [
        ({}, ()),
        ({2: 1000}, ((2, "load_force", 10.0, 0.0),)),
        ({2: 1000, 3: 200}, ((2, "load_force", 10.0, 2.0),)),
        # A stand that reads a channel in stretches, and a loss of messages.
        ({2: 1000, 3: 500}, ()),
        ({2: 90}, ()),
    ],
    ids=["none", "one", "one far longer than all others", "two alike", "too short"],
)
def test_the_recording_with_a_gap_far_longer_than_all_others_is_named(gaps, named):
    assert missing_alone(recordings(gaps), PERIOD_S) == named


def test_a_channel_that_is_never_read_is_not_missing():
    runs = recordings(dict.fromkeys(range(5), 2000))
    assert missing_alone(runs, PERIOD_S) == ()
    assert missing_alone(recordings({1: 2000}), PERIOD_S) == ()
