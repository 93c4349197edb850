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

"""An episode closes after a time of quiet; while a condition voids relations there is none."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.detection import detection
from flea_diag.stages.observer.detection_episode import DetectionEpisode

FLEA = compiled_relations("actuator.yaml").residuals

SECOND_NS = 1_000_000_000
MECHANICAL = FLEA.place["parity_mechanical"]


def results(z: float, void: bool = False) -> detection.TestResults:
    found = detection.TestResults(len(FLEA.rows))
    found.z[0, MECHANICAL], found.k[0, MECHANICAL], found.window[0, MECHANICAL] = z, 5.0, 50
    found.void = void
    return found


@pytest.mark.parametrize(("void", "closes"), [(False, True), (True, False)])
def test_an_untested_residual_is_quiet_unless_it_is_void(void: bool, closes: bool) -> None:
    episode = DetectionEpisode(FLEA, rearm_after_s=2.0)
    assert episode.step(0, results(9.0))
    for second in range(1, 6):
        episode.step(second * SECOND_NS, results(np.nan, void))
    assert episode.is_open is not closes


def test_blocks_count_as_single_scans_do() -> None:
    episode = DetectionEpisode(FLEA, rearm_after_s=2.0)
    episode.step(0, results(9.0))
    stamps_ns = np.arange(1, 6) * SECOND_NS
    many = detection.TestResults(len(FLEA.rows), 5)
    many.void = True
    assert episode.follow(stamps_ns, many) == 5
    many.void = False
    assert episode.follow(stamps_ns + 5 * SECOND_NS, many) == 2
