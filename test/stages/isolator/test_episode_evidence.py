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

"""Which scans count as evidence of an episode."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.stages.isolator.episode_evidence import EpisodeEvidence
from flea_diag.wire.blocks import ResidualBlock

KNOWN = compiled_relations("actuator.yaml").residuals
NAMES = ("parity_mechanical", "parity_drive")
SIGNALS = ("one", "elapsed_s", "direction", "motor_speed", "d_actuator_position")
SCANS, S = 600, 1_000_000_000


def evidence(speed: float, rate: float, cut: int, lost: slice = slice(0)) -> EpisodeEvidence:
    """Of six seconds in motion, or against a push, by encoder (rad/s) and position (mm/s)."""
    acting = np.array([[True, False, False, False, False], [True, False, False, True, False]])
    parameters: Any = SimpleNamespace(encoder_m_per_rad=1e-3, moving_m_s=1e-3)
    counts = ScanCounts(0.01)
    basis = Basis(SIGNALS, (), ())
    made = EpisodeEvidence(NAMES, basis, acting, 0, 0, parameters, KNOWN, counts)
    regressors = np.tile((1.0, 0.0, 1.0, speed, 1e-3 * rate, 1.0), (SCANS, 1))
    regressors[lost, 3] = np.nan
    stamps, nothing = np.arange(1, SCANS + 1) * S // 100, np.empty((SCANS, 0))
    values = np.ones((SCANS, 2))
    block = ResidualBlock(
        stamps, NAMES, values, values, values, (), regressors, (), nothing, nothing, nothing
    )
    for part in (slice(cut), slice(cut, None)):
        made.add(block.part(part))
    return made


@pytest.mark.parametrize("cut", [1, 250])
def test_of_a_standstill_against_a_push_few_scans_count_for_the_friction(cut) -> None:
    for speed, rate, counted in ((0.0, 0.0, 20.0), (90.0, 90.0, 600.0), (11.0, 0.0, 20.0)):
        found = evidence(speed, rate, cut)
        found.equations.fade(1.0)
        assert found.equations.samples.tolist() == [counted, 600.0]
        assert found.mostly_stands is (rate == 0.0)
        assert found.moves(6.0)


def test_without_a_signal_that_a_fault_acts_by_a_residual_says_nothing() -> None:
    found = evidence(90.0, 90.0, 1, slice(100, 300))
    found.equations.fade(1.0)
    assert found.equations.samples.tolist() == [600.0, 400.0]
