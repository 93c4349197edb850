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

"""Relations by power: a stepper of which supply current, position and load are known."""

from __future__ import annotations

import copy
import math
from types import SimpleNamespace

import numpy as np
import pytest
from support.models.stepper import DESCRIPTION, LEAD

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.faults.fault import FaultHypothesis
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.residuals.relation_compiler import relation_set
from flea_diag.core.residuals.relation_set import DIRECTION, RelationSet
from flea_diag.core.symbolic.expression import evaluate, symbols
from flea_diag.errors import ConfigurationError, ModelError

STAND = DESCRIPTION
HELD = tuple(STAND["base_parameters"])[:-1]
P = SimpleNamespace(
    supply_voltage_v=48.0,
    current_offset_a=0.4,
    reflected_mass_kg=500.0,
    coulomb_friction_n=150.0,
    viscous_friction_n_s_per_m=3000.0,
    stribeck_speed_m_s=0.002,
)
UNITS = ("coulomb_friction_n", "current_offset_a")


def compiled() -> RelationSet:
    return relation_set(actuator(STAND), ["parity_power"], HELD, UNITS)


def by_hand(current_a: float, speed: float, rate: float, load_n: float) -> float:
    """Power from the supply less what friction, load and inertia take, at the nut."""
    drawn = P.supply_voltage_v * (current_a - P.current_offset_a)
    dry = P.coulomb_friction_n * math.tanh(speed / P.stribeck_speed_m_s)
    rubbed = (dry + P.viscous_friction_n_s_per_m * speed) * speed
    return drawn - rubbed - load_n * speed - P.reflected_mass_kg * speed * rate


@pytest.mark.parametrize("speed", [0.024, -0.024, 0.001, 0.0])
@pytest.mark.parametrize("load_n", [392.0, -392.0])
def test_power_is_balanced_as_by_hand(speed: float, load_n: float) -> None:
    known = compiled()
    given = {
        "motor_current": 0.9,
        "d_actuator_position": speed,
        "d_d_actuator_position": 0.1,
        "commanded_load": load_n,
        DIRECTION: math.tanh(speed / P.stribeck_speed_m_s),
    }
    x = [given[name] for name in known.signals]
    (found,) = known.functions["relations"](P, x)
    assert found == pytest.approx(by_hand(0.9, speed, 0.1, load_n), rel=1e-12, abs=1e-12)
    ((dry, idle),) = known.functions["spreads"](P, x)
    assert dry == pytest.approx(-given[DIRECTION] * speed)
    assert idle == -48.0


def test_what_happens_inside_the_drive_is_in_no_relation() -> None:
    (row,) = compiled().relations
    assert not {"duty", "encoder_m_per_rad", "screw_ratio"} & set(symbols(row.expression))
    assert row.unit == "W"


def test_columns_run_as_single_scans_do() -> None:
    known, draw = compiled(), np.random.default_rng(0)
    x = draw.normal(size=(len(known.signals), 40))
    (many,) = known.functions["relations"](P, list(x))
    for k in range(40):
        assert known.functions["relations"](P, x[:, k].tolist())[0] == many[k]


def test_a_power_is_no_push_on_something_that_stands() -> None:
    known = compiled()
    assert known.functions["drag"](P, [0.0] * len(known.signals)) == (0.0, 0.0)


def test_lost_lubrication_draws_more_current_both_ways() -> None:
    model = actuator(STAND)
    relation = parity_relation(model, model.residuals["parity_power"])
    effect = relation.regressor(FaultHypothesis("coulomb", 1, ""))
    for speed in (0.024, -0.024):
        values = {**model.graph.values(), "d_actuator_position": speed}
        # 0.1 N m over the lead, 126 N, at 24 mm/s takes 3 W.
        assert 0.1 * evaluate(effect, values) == pytest.approx(0.1 / LEAD * 0.024, rel=1e-6)


def test_no_balance_of_forces_closes_behind_a_drive() -> None:
    content = copy.deepcopy(STAND)
    content["residuals"] = {"mechanical": {"kind": "junction", "junction": "shaft", "unit": "N*m"}}
    model = actuator(content)
    with pytest.raises(ModelError, match="the effort of a drive is not measured"):
        parity_relation(model, model.residuals["mechanical"])


@pytest.mark.parametrize("names", [[], ["drive"]])
def test_a_power_needs_junctions(names: list[str]) -> None:
    content = copy.deepcopy(STAND)
    content["residuals"]["parity_power"]["junctions"] = names
    with pytest.raises(ConfigurationError, match="is no junction"):
        actuator(content)
