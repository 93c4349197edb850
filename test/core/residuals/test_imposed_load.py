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

"""A load that is commanded, no sensor reading it, takes its part in the friction of a screw."""

from __future__ import annotations

import copy
from types import SimpleNamespace

import pytest
from support.models.stepper import DESCRIPTION

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import DIRECTION

P = SimpleNamespace(
    supply_voltage_v=44.0,
    current_offset_a=0.4,
    reflected_mass_kg=0.0,
    coulomb_friction_n=800.0,
    viscous_friction_n_s_per_m=0.0,
    stribeck_speed_m_s=0.002,
    load_friction_ratio=0.3,
)


def loaded(load: str = "MSe") -> dict[str, object]:
    """The stepper with a friction that grows with the load, which a junction of its own carries."""
    content = copy.deepcopy(DESCRIPTION)
    content["parameters"]["load_friction"] = {"value": 2.0e-4, "unit": "m"}
    content["junctions"]["load_path"] = {"type": "0", "domain": "translation"}
    friction = content["elements"]["friction"]
    friction |= {"law": "loaded_friction", "modulated_by": "load_path"}
    friction["parameters"]["load_share"] = "load_friction"
    if load == "gain":
        content["parameters"]["share"] = {"value": 1.0, "unit": "1"}
        content["elements"]["load"] |= {"law": "gain", "parameters": {"gain": "share"}}
    content["bonds"][-1:] = ["nut -> load_path", "load_path -> load"]
    content["base_parameters"]["load_friction_ratio"] = "load_friction/screw_ratio"
    return content


@pytest.mark.parametrize(("speed", "load_n"), [(0.024, 392.0), (0.024, -392.0), (-0.024, 196.0)])
def test_friction_grows_with_the_load_whatever_its_sign(speed: float, load_n: float) -> None:
    known = relation_set(actuator(loaded()), ["parity_power"], tuple(vars(P)), ())
    way = 1.0 if speed > 0.0 else -1.0
    given = {
        "motor_current": 1.0,
        "d_actuator_position": speed,
        "d_d_actuator_position": 0.0,
        "commanded_load": load_n,
        DIRECTION: way,
    }
    (found,) = known.functions["relations"](P, [given[name] for name in known.signals])
    by_hand = 44.0 * 0.6 - (800.0 + 0.3 * 392.0 * abs(load_n) / 392.0) * abs(speed) - load_n * speed
    assert found == pytest.approx(by_hand, rel=1e-12)


def test_the_load_of_a_source_with_a_gain_is_not_known() -> None:
    known = relation_set(actuator(loaded("gain")), ["parity_power"], tuple(vars(P)), ())
    assert not known.relations
