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

"""What a balance of power is fitted with: no friction below 0, and no tolerance of a DC motor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.models import stepper
from support.observed import FLEA_TOLERANCE, flea_parameters

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.calibration import Calibration, NominalRun
from flea_diag.core.calibration.run_spread import HEATING, tolerance_of
from flea_diag.errors import CalibrationError
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.procedure import calibrate

FALLING = 2000.0
"""By how much the drag falls per m/s, N s/m: what a viscous friction below 0 would be."""


def recording(number: int) -> NominalRecording:
    columns = stepper.run(number)
    speed = np.gradient(columns["actuator_position"], stepper.PERIOD_S)
    columns["motor_current"] -= (stepper.VISCOUS + FALLING) * speed**2 / stepper.SUPPLY_V
    run = NominalRun(f"run{number}", stepper.rows(columns))
    return NominalRecording(run, "stepper", stepper.CHANNELS, "", stepper.PERIOD_S)


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stepper") / "actuator.yaml"
    path.write_text(yaml.safe_dump(stepper.DESCRIPTION, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def learned(described: Path) -> Calibration:
    return calibrate([recording(n) for n in range(4)], described, 0.1)


@pytest.mark.slow
def test_a_friction_below_0_counts_as_0_and_the_others_are_fitted_without_it(
    learned: Calibration,
) -> None:
    p = learned.parameters
    assert p.viscous_friction_n_s_per_m == 0.0
    assert "which is none: 0 taken" in learned.not_identified["viscous_friction_n_s_per_m"]
    assert "viscous_friction_n_s_per_m" not in learned.sigmas
    # The drag at the speeds that were run, 24 to 40 mm/s, for which the dry friction now stands.
    idle_n = p.supply_voltage_v * (p.current_offset_a - stepper.IDLE_A) / 0.032
    drag_n = p.coulomb_friction_n + idle_n
    assert stepper.DRY_N - FALLING * 0.040 < drag_n < stepper.DRY_N


def test_units_differ_by_what_their_description_says(learned: Calibration, described: Path) -> None:
    relations = compiled_relations(described, stepper.CHANNELS, has_encoder=False)
    parameters = replace(flea_parameters(), coulomb_friction_n=500.0, current_offset_a=0.4)
    found = tolerance_of(parameters, relations)
    assert (found.coulomb_friction_n, found.current_offset_a) == (5.0, 0.004)
    assert learned.tolerance.coulomb_friction_n == 0.01 * learned.parameters.coulomb_friction_n


def test_a_tolerance_in_numbers_is_that_of_any_value() -> None:
    relations = compiled_relations("actuator.yaml")
    assert tolerance_of(flea_parameters(), relations) == FLEA_TOLERANCE


def test_without_a_statement_it_is_a_tenth_of_the_value_or_three_noises_of_the_sensor() -> None:
    drawn = compiled_relations("actuator.yaml")
    with pytest.raises(CalibrationError, match=r"predicts motor_.* no tolerance thermal_rate"):
        tolerance_of(flea_parameters(), replace(drawn, tolerances={}))
    relations = replace(drawn, tolerances={HEATING: drawn.tolerances[HEATING]})
    found = tolerance_of(flea_parameters(winding_resistance_ohm=0.5), relations)
    assert found.winding_resistance_ohm == pytest.approx(0.05)
    assert found.current_offset_a == pytest.approx(3.0 * 0.053)
