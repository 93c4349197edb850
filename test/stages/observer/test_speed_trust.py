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

"""A position step reads as a speed for as long as the kernel contains it."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_rows import SPEED
from flea_diag.stages.observer.speed_trust import SpeedTrust

FLEA = compiled_relations("actuator.yaml").residuals

LASTS = 31 + 6  # scans of the kernel, and of the straight line that a step is found by


def moving(scans: int, *jumps: int) -> ResidualRows:
    """Residuals of scans in motion; in those of ``jumps`` the position steps."""
    values = np.zeros((scans, len(FLEA.rows)))
    values[list(jumps), FLEA.place["actuator_position"]] = 2.0
    spread = np.zeros((scans, len(FLEA.spreading), len(UNIT_PARAMETERS)))
    nothing = np.zeros((scans, 2))
    return ResidualRows(values, spread, nothing, nothing, np.ones(scans, dtype=bool))


@pytest.mark.parametrize("block", [1, 13, 100])
def test_a_position_step_takes_the_speed_out_for_as_long_as_the_kernel_sees_it(block):
    trust, whole = SpeedTrust(FLEA, has_encoder=False, kernel=31), moving(100, 20)
    for start in range(0, 100, block):
        at = slice(start, start + block)
        parts = (whole.values, whole.spread, whole.signals, whole.motion, whole.moving)
        part = ResidualRows(*(column[at] for column in parts))
        trust.leave_out(part)
    speeds = [j for j, row in enumerate(FLEA.rows) if SPEED in row.needs]
    lost = np.isnan(whole.values[:, speeds])
    assert lost.any(axis=1).tolist() == [False] * 20 + [True] * LASTS + [False] * (80 - LASTS)
    assert lost[20 : 20 + LASTS].all()
    assert whole.moving.tolist() == [True] * 20 + [False] * LASTS + [True] * (80 - LASTS)
    assert not np.isnan(np.delete(whole.values, speeds, axis=1)).any()


def test_an_encoder_measures_the_speed_itself():
    trust, whole = SpeedTrust(FLEA, has_encoder=True, kernel=31), moving(50, 20)
    trust.leave_out(whole)
    assert whole.moving.all()
    assert not np.isnan(whole.values).any()
