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

"""Sizes by the whole of a recording, on the simulated stand."""

from __future__ import annotations

import math

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.component import make_observer
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.errors import ConfigurationError
from flea_diag.stages.sizes.recording_sizes import RecordingSize, RecordingSizes
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.tools.replay.replay import diagnosed
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import Residual, Truth
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

STAND = load_stand("flea")
TURN_OHM = 2.95
"""Resistance of all turns of the simulated winding."""


@pytest.fixture(scope="module")
def sized() -> RecordingSizes:
    return RecordingSizes(knowledge(STAND, learned(STAND)), "winding_short")


def recorded(
    sized: RecordingSizes, share: float, seed: int, kind: str = "sine"
) -> tuple[RecordingSize, ...]:
    """Sizes of a short of this share of the turns, in a recording of 20 s of one unit."""
    values = {
        "machine": "flea", "duration_s": 20.0, "seed": seed, "unit_seed": 7,
        "sensors": {"vibration": False},
        "motion": {"kind": kind, "amplitude_m": 0.02, "frequency_hz": 0.5, "centre_m": 0.045},
        "load": {"constant_n": 40.0 * seed},
        "faults": [{"fault": "winding_short", "onset_s": 0.0, "size": share}] if share else [],
    }  # fmt: skip
    records = SimulatedStand(scenario_from_mapping(values, "test"))
    given = in_blocks(record for record in records if not isinstance(record, Truth))
    sized.begin()
    for record in diagnosed(given, make_observer(STAND)):
        if isinstance(record, (Residual, ResidualBlock)):
            sized.add(record)
    return sized.sizes()


@pytest.mark.slow
def test_differences_within_a_unit_are_far_better_known_than_the_unit(
    sized: RecordingSizes,
) -> None:
    new, small, large = (recorded(sized, share, k)[0] for k, share in enumerate((0.0, 0.04, 0.15)))
    assert new.of.name == "resistance lost"
    assert new.error.shared > 5.0 * new.error.own
    apart = math.hypot(new.error.own, large.error.own)
    for worn, share in ((small, 0.04), (large, 0.15)):
        assert worn.size - new.size == pytest.approx(share * TURN_OHM, abs=3.0 * apart)
    assert abs(new.size) < 3.0 * new.error.total
    assert large.size - new.size > 4.0 * apart, "found, where no verdict says anything yet"


def test_a_recording_without_motion_has_no_size(sized: RecordingSizes) -> None:
    assert recorded(sized, 0.0, 0, "hold") == ()


def test_a_fault_without_a_size_is_refused_with_those_that_have_one() -> None:
    with pytest.raises(ConfigurationError, match=r"rotor_eccentricity.*winding_short"):
        RecordingSizes(knowledge(STAND, learned(STAND)), "rotor_eccentricity")
