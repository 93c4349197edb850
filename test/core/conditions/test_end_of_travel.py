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

"""What shows that a part pressed against its stop turns after all, and what does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import stands
from support.observed import FLEA_COUNTS

from flea_diag.core.conditions.contact import Contact
from flea_diag.core.conditions.end_of_travel import EndOfTravel
from flea_diag.core.residual_values import ResidualRows

LEAD_M = 5e-4
PUSH_N = 1000.0
WARMER_V = 12.0
"""Drop of voltage as of a winding that is much warmer than predicted."""


def pressed(motor_rad_s: float, read: float = 1.0, range_rad_s: float = math.inf) -> list[Contact]:
    """State after 0.5 s of travel to the lower end, 0.5 s in contact, 0.2 s with the drop as well.

    With the drop the motor reads ``motor_rad_s`` (NaN: no encoder), on the way the share ``read``
    of its speed.
    """
    calibration, relations = stands.calibration(), stands.relations()
    rows, p = relations.residuals, replace(calibration.parameters, encoder_m_per_rad=LEAD_M)
    travel = EndOfTravel(relations, calibration.tolerance, 0.1, 0.01, FLEA_COUNTS)
    travel.bound(-range_rad_s, range_rad_s)
    readings = np.full((120, len(rows.channels)), np.nan)
    readings[:, rows.index["actuator_position"]] = np.append(
        np.linspace(0.02, 0.0, 50), np.zeros(70)
    )
    readings[:, rows.index["motor_speed"]] = np.repeat(
        (-0.04 * read / LEAD_M, 0.0, motor_rad_s), (50, 50, 20)
    )
    values = np.zeros((120, len(rows.rows)))
    values[50:, rows.column("parity_mechanical")] = (
        PUSH_N * relations.stop.reactions["parity_mechanical"]
    )
    values[100:, rows.column(rows.circuit)] = WARMER_V
    still, known = np.zeros((1, 2)), np.ones(1, dtype=bool)
    signals, found = np.zeros((1, len(relations.signals))), []
    for k in range(120):
        scan = slice(k, k + 1)
        residuals = ResidualRows(values[scan], np.empty((1, 0, 0)), signals, still, known)
        travel.step(p, readings[scan], residuals, known)
        found.append(travel.contact)
    return found


def test_a_position_and_an_encoder_that_stand_outweigh_the_back_emf() -> None:
    states = pressed(0.0)
    assert states[99] is Contact.HELD
    assert set(states[100:]) == {Contact.HELD}


@pytest.mark.parametrize("motor_rad_s", [math.nan, 200.0], ids=["no encoder", "it turns"])
def test_the_back_emf_outweighs_a_position_alone(motor_rad_s: float) -> None:
    states = pressed(motor_rad_s)
    assert states[99] is Contact.HELD
    assert states[100] is Contact.LEAVING


def test_an_encoder_at_the_limit_of_its_range_contradicts_no_position() -> None:
    """A runaway: it turns farther than the encoder can tell."""
    assert Contact.HELD not in pressed(0.0, read=0.5)
    assert pressed(0.0, read=0.5, range_rad_s=0.02 / LEAD_M)[99] is Contact.HELD
