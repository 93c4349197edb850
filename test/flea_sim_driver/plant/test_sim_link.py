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

"""A simulated link under gravity: what its torque sensor reads at rest, and what a payload adds."""

from __future__ import annotations

import math

import pytest
from support.stand_runs import records, scans

LEVEL, LINK, ARM, GRAVITY = 1.8, 1.9, 0.55, 9.81
"""Of config/machines/shoulder.yaml: rad, kg m, m, m/s^2."""


@pytest.mark.parametrize(("angle", "payload"), [(1.8, 0.0), (0.9, 3.0)])
def test_it_hangs_by_its_moment(angle: float, payload: float) -> None:
    motion = {"kind": "hold", "centre_m": angle}
    run = scans(records(machine="shoulder", motion=motion, load={"payload_kg": payload},
                        unit_spread=0.0, duration_s=3.0))  # fmt: skip
    moment = GRAVITY * (LINK + ARM * payload) * math.cos(angle - LEVEL)
    hoses = 0.5 * (angle - 1.5)
    torque = float(run["load_force"][200:].mean())
    # Friction of the bearing of the arm holds up to 0.4 N m of it, and roughness shakes it.
    assert torque == pytest.approx(moment + hoses, abs=0.6)
