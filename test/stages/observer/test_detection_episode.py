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

"""What is an event while an episode is open, in blocks as scan by scan."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.detection import detection
from flea_diag.core.detection.symbols import SLOPE_S
from flea_diag.stages.observer.detection_episode import DetectionEpisode

FLEA = compiled_relations("actuator.yaml").residuals
MECHANICAL = FLEA.place["parity_mechanical"]


def results(shifted: list[bool]) -> detection.TestResults:
    """Scans in which a relation deviates, in some of them for a coefficient has shifted."""
    found = detection.TestResults(len(FLEA.rows), len(shifted))
    found.z[:, MECHANICAL], found.k[:, MECHANICAL], found.window[:, MECHANICAL] = 9.0, 5.0, 50
    if any(shifted):
        found.along[MECHANICAL] = "load_force", np.array(shifted)
    return found


@pytest.mark.parametrize(
    ("shifted", "event"), [([True] * 4, 4), ([True, True, False, True], 2), ([False] * 4, 0)]
)
def test_a_symbol_without_a_sign_waits_for_one_and_has_no_slope(
    shifted: list[bool], event: int
) -> None:
    episode = DetectionEpisode(FLEA, rearm_after_s=2.0)
    assert episode.step(0, results([True]))
    stamps_ns = round(2e9 * SLOPE_S) + np.arange(4) * 10_000_000
    assert episode.follow(stamps_ns, results(shifted)) == event
    scans = zip(stamps_ns.tolist(), shifted, strict=True)
    alone = [bool(episode.step(stamp_ns, results([each]))) for stamp_ns, each in scans]
    assert alone.index(True) == event if event < 4 else not any(alone)
