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

"""How an episode begins: what of a detection both sides keep."""

from __future__ import annotations

import math

import pytest

from flea_diag.stages.episode import Episode
from flea_diag.wire.records import TAKEN_OVER, Detection

AT_NS = 5_000_000_000


def detection(residual: str, test: str, z: float = 9.0, threshold: float = 5.0) -> Detection:
    return Detection(AT_NS, 3, True, residual, z, threshold, test)


@pytest.mark.parametrize(
    ("test", "shift"),
    [
        ("mean of 50 samples", ""),
        ("mean of 400 samples, 8.1 N above its earlier level", "parity_mechanical_dn"),
    ],
)
def test_a_detection_says_which_test_opened_it_and_whether_that_is_a_shift(test, shift) -> None:
    episode = Episode.of(detection("parity_mechanical_dn", test), 7)
    assert (episode.number, episode.detection_number, episode.detected_ns) == (7, 3, AT_NS)
    assert episode.opened_by == f"parity_mechanical_dn: z = 9, limit 5, {test}"
    assert episode.opening_shift == shift
    assert not episode.taken_over
    assert not episode.opened_by_vibration


def test_an_episode_taken_over_has_no_test_of_its_own() -> None:
    episode = Episode.of(detection("", TAKEN_OVER, math.nan, math.nan), 3)
    assert episode.taken_over
    assert episode.opening_shift == ""
    assert "nan" not in episode.opened_by
