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

"""Two positions with a coupling between them: it stretches under the load, and wears a gap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flea_diag.configuration import description
from flea_diag.configuration.calibrations import learned
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.core.bond_graph.actuator import Actuator
from flea_diag.core.likelihood.effects import EffectRules
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.symbolic.expression import Constant, evaluate
from flea_diag.errors import ModelError

STAND = load_stand("ema")
KINEMATIC, COMPLIANCE, OFFSET_M, PLAY_M, CONTACT_N = "parity_kinematic", 6e-8, 3e-5, 2e-4, 40.0
PARAMETERS = {
    "coupling_compliance": COMPLIANCE,
    "position_offset": OFFSET_M,
    "coupling_play": PLAY_M,
}


def model() -> Actuator:
    return description.described(STAND.actuator)


def positions(force_n: float) -> dict[str, float]:
    """As a spring and a gap leave them, the load side at 70 mm."""
    apart = COMPLIANCE * force_n + 0.5 * PLAY_M * np.tanh(force_n / CONTACT_N)
    return {
        "load_position": 0.07,
        "load_force": force_n,
        "actuator_position": 0.07 + OFFSET_M + apart,
    }


@pytest.mark.parametrize("force_n", [-5000.0, -30.0, 0.0, 30.0, 5000.0])
def test_stretch_and_play_part_two_positions(force_n: float) -> None:
    spec = model().residuals[KINEMATIC]
    relation = parity_relation(model(), spec)
    assert relation(positions(force_n), PARAMETERS) == pytest.approx(0.0, abs=1e-12)
    turned = replace(spec, channel=spec.reference, reference=spec.channel)
    other = parity_relation(model(), turned)
    against = {**PARAMETERS, "position_offset": -OFFSET_M}
    assert other(positions(force_n), against) == pytest.approx(0.0, abs=1e-12)


def test_a_store_elsewhere_lies_between_no_two_positions() -> None:
    spec = replace(model().residuals[KINEMATIC], across="nut_mass")
    with pytest.raises(ModelError, match=r"no 0-junction joins nut.* with nut_mass"):
        parity_relation(model(), spec)


def test_a_wider_gap_parts_them_by_half_of_it_on_the_side_of_the_load() -> None:
    relations = description.compiled_relations(STAND.actuator)
    effects = EffectRules(relations).moved({"coupling_play_m": Constant(PLAY_M)})
    assert [effect.residual for effect in effects] == [KINEMATIC]
    for force_n in (-5000.0, 5000.0):
        shape = relations.shapes[str(effects[0].basis)]
        known = {"load_force": force_n, "contact_force": CONTACT_N}
        side = float(evaluate(shape, known))
        moved = float(evaluate(effects[0].gain, {})) * side
        assert moved == pytest.approx(np.copysign(0.5 * PLAY_M, force_n))


def test_the_motion_keeps_its_direction() -> None:
    relations = description.compiled_relations(STAND.actuator)
    assert "motor_speed" in str(relations.shapes["direction"])
    assert relations.residuals.friction == "parity_mechanical"


@pytest.mark.slow
def test_backlash_is_among_what_this_stand_shows() -> None:
    known = knowledge(STAND, learned(STAND))
    models = [m for m in known.effects.bound(known.calibration.parameters) if m.fault == "backlash"]
    assert [term.residual for model in models for term in model.terms] == [KINEMATIC]


def test_recordings_fix_the_compliance_and_leave_the_play() -> None:
    """The simulated coupling has 1 / (2.2e7 N/m)."""
    calibration = learned(STAND)
    compliance = calibration.parameters.coupling_compliance_m_per_n
    sigma = calibration.sigmas["coupling_compliance_m_per_n"]
    assert sigma < 0.1 * compliance
    assert abs(compliance - 1.0 / 2.2e7) < 3.0 * sigma
    assert "coupling_play_m" in calibration.not_identified
