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

"""Which unit the recordings of a calibration are of, by their first seconds."""

from __future__ import annotations

import math

import numpy as np
from support import stands

from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitSpread
from flea_diag.tools.calibrate.recorded_units import with_starts

RESISTANCE = "winding_resistance_ohm"


def started(name: str, change: float) -> Trace:
    """A recording whose first seconds show so much more resistance, and nothing after them."""
    rows, scans = stands.relations().residuals, 2000
    column = rows.place["parity_electrical"]
    values = np.zeros((scans, len(rows.rows)))
    spread = np.zeros((scans, len(rows.spreading), len(UNIT_PARAMETERS)))
    current = 2.0 * np.sin(0.05 * np.arange(scans))
    spread[:, rows.spreading.index(column), UNIT_PARAMETERS.index(RESISTANCE)] = current
    values[:600, column] = -change * current[:600]
    still = np.ones(scans)
    return Trace(name, rows, values, still, still.astype(bool), still.astype(bool), spread)


def test_what_the_first_seconds_of_a_healthy_recording_show_is_no_other_unit() -> None:
    known, calibration = UnitSpread(1, {RESISTANCE: 0.01}), stands.calibration()
    quiet = started("quiet", 0.0)
    assert with_starts(known, calibration, [quiet, quiet]) == known
    wider = with_starts(known, calibration, [quiet, started("odd", 1.0)]).spread[RESISTANCE]
    assert 0.5 < wider < 1.0 / math.sqrt(2.0)
