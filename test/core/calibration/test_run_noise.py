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

"""Noise of the circuit within one run, and what recordings of one unit differ by."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import effects
from flea_diag.configuration.stand import load_stand
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.calibration.run_noise import run_noise
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.residuals.parameters import UnitSpread
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation

CIRCUIT = "parity_electrical"
BACK_EMF, FRICTION = "back_emf_v_s_per_m", "coulomb_friction_n"
WINDOW, BEFORE = 400, 2000


def calibrated(correlation: float, noise: float = 0.1) -> Calibration:
    """Whose shifts in the circuit say that so many samples are one independent sample."""
    shift = noise * math.sqrt(correlation * (1.0 / WINDOW + 1.0 / BEFORE))
    known = learned(load_stand())
    limit = replace(known.limit(CIRCUIT), sigma=(0.2, 0.2, 0.2), correlation_samples=40.0)
    shifts = (
        MeanShiftLimit(CIRCUIT, WINDOW, shift, 6.0),
        MeanShiftLimit(CIRCUIT, WINDOW, noise, 6.0, along="motor_current"),
    )
    return replace(known, limits=(limit,), shifts=shifts, sources=("run",) * 16, units=None)


def test_noise_and_its_correlation_follow_from_the_shifts_within_recordings() -> None:
    run = run_noise(calibrated(15.0), CIRCUIT, ())
    assert run is not None
    assert run.sigma == 0.1
    assert run.correlation == pytest.approx(15.0)


@pytest.mark.parametrize("said", ["level that wanders", "no coefficient", "no relation"])
def test_the_scatter_over_recordings_stays_where_a_run_says_less(said: str) -> None:
    known = calibrated(60.0 if said == "level that wanders" else 15.0)
    if said == "no coefficient":
        known = replace(known, shifts=known.mean_shifts)
    assert run_noise(known, "" if said == "no relation" else CIRCUIT, ()) is None


def test_units_differ_by_no_less_than_recordings_do() -> None:
    known = replace(calibrated(15.0), sigmas={BACK_EMF: 2.0, FRICTION: 20.0})
    run = run_noise(known, CIRCUIT, {BACK_EMF})
    assert run is not None
    assert known.tolerance.back_emf_v_s_per_m < 8.0
    # Sixteen recordings whose mean is known to 2 differ by 8; friction is not of the circuit.
    assert run.tolerance == replace(known.tolerance, back_emf_v_s_per_m=8.0)
    told = run_noise(replace(known, units=UnitSpread(3)), CIRCUIT, {BACK_EMF})
    assert told is not None
    assert told.tolerance == known.tolerance


def test_the_isolator_weighs_the_circuit_by_it() -> None:
    known = replace(calibrated(15.0), sigmas={BACK_EMF: 2.0})
    weighed = QuantitativeIsolation(known, effects(load_stand(), known)).weights
    assert weighed.sigma[CIRCUIT] == 0.1
    assert weighed.correlation[CIRCUIT] == pytest.approx(15.0)
    assert 8.0 in weighed.tolerances
