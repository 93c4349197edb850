"""Relations by power: a stepper of which supply current, position and load are known."""

from __future__ import annotations

import copy
import math
from types import SimpleNamespace

import numpy as np
import pytest

from flea_diag.core.bond_graph.actuator import actuator
from flea_diag.core.faults.fault import FaultHypothesis
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.residuals.relation_set import DIRECTION, RelationSet, relation_set
from flea_diag.core.symbolic.expression import evaluate, symbols
from flea_diag.errors import ConfigurationError, ModelError

LEAD = 0.005 / (2.0 * math.pi)
STAND = {
    "name": "stepper",
    "scan_period_s": 0.04,
    "parameters": {
        "supply_voltage": {"value": 60.0, "unit": "V"},
        "idle_current": {"value": 0.42, "unit": "A"},
        "duty": {"value": 3.0, "unit": "V/N/m"},
        "rotor_inertia": {"value": 3.0e-4, "unit": "kg*m^2"},
        "coulomb": {"value": 0.1, "unit": "N*m"},
        "viscous": {"value": 2.0e-3, "unit": "N*m*s/rad"},
        "smooth_speed": {"value": 3.0, "unit": "rad/s"},
        "screw_ratio": {"value": LEAD, "unit": "m/rad"},
    },
    "junctions": {
        "supply_side": {"type": "1", "domain": "electrical"},
        "shaft": {"type": "1", "domain": "rotation"},
        "nut": {"type": "1", "domain": "translation"},
    },
    "elements": {
        "supply": {
            "type": "Se",
            "law": "constant_effort",
            "parameters": {"level": "supply_voltage"},
        },
        "drive": {"type": "TF", "law": "converter", "parameters": {"ratio": "duty"}},
        "rotor": {"type": "I", "state": "omega", "parameters": {"inertia": "rotor_inertia"}},
        "friction": {
            "type": "R",
            "law": "friction",
            "parameters": {
                "coulomb": "coulomb",
                "viscous": "viscous",
                "smooth_flow": "smooth_speed",
            },
        },
        "screw": {"type": "TF", "parameters": {"ratio": "screw_ratio"}},
        "load": {"type": "MSe", "signal": "commanded_load"},
    },
    "bonds": [
        "supply -> supply_side",
        "supply_side -> drive",
        "drive -> shaft",
        "shaft -> rotor",
        "shaft -> friction",
        "shaft -> screw",
        "screw -> nut",
        "nut -> load",
    ],
    "sensors": {
        "motor_current": {
            "at": "supply_side",
            "unit": "A",
            "noise": 0.01,
            "offset": "idle_current",
        },
        "actuator_position": {
            "at": "nut",
            "unit": "m",
            "noise": 1e-5,
            "integrates": True,
            "state": "x_nut",
        },
    },
    "inputs": {"commanded_load": {"unit": "N"}},
    "operating_point": {"hold": {"motor_current": 0.5}, "by": ["commanded_load"]},
    "residuals": {
        "parity_power": {
            "kind": "power",
            "junctions": ["supply_side", "shaft", "nut"],
            "unit": "W",
        },
    },
    "base_parameters": {
        "supply_voltage_v": "supply_voltage",
        "idle_current_a": "idle_current",
        "reflected_mass_kg": "rotor_inertia/screw_ratio^2",
        "coulomb_friction_n": "coulomb/screw_ratio",
        "viscous_friction_n_s_per_m": "viscous/screw_ratio^2",
        "stribeck_speed_m_s": "smooth_speed*screw_ratio",
        "lead_m_per_rad": "screw_ratio",
    },
}
HELD = tuple(STAND["base_parameters"])[:-1]
P = SimpleNamespace(
    supply_voltage_v=48.0,
    idle_current_a=0.4,
    reflected_mass_kg=500.0,
    coulomb_friction_n=150.0,
    viscous_friction_n_s_per_m=3000.0,
    stribeck_speed_m_s=0.002,
)
UNITS = ("coulomb_friction_n", "idle_current_a")


def compiled() -> RelationSet:
    return relation_set(actuator({"schema_version": 1, **STAND}), ["parity_power"], HELD, UNITS)


def by_hand(current_a: float, speed: float, rate: float, load_n: float) -> float:
    """Power from the supply less what friction, load and inertia take, at the nut."""
    drawn = P.supply_voltage_v * (current_a - P.idle_current_a)
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
    assert not {"duty", "lead_m_per_rad", "screw_ratio"} & set(symbols(row.expression))
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
    model = actuator({"schema_version": 1, **STAND})
    relation = parity_relation(model, model.residuals["parity_power"])
    effect = relation.regressor(FaultHypothesis("coulomb", 1, ""))
    for speed in (0.024, -0.024):
        values = {**model.graph.values(), "d_actuator_position": speed}
        # 0.1 N m over the lead, 126 N, at 24 mm/s takes 3 W.
        assert 0.1 * evaluate(effect, values) == pytest.approx(0.1 / LEAD * 0.024, rel=1e-6)


def test_no_balance_of_forces_closes_behind_a_drive() -> None:
    content = copy.deepcopy(STAND)
    content["residuals"] = {"mechanical": {"kind": "junction", "junction": "shaft", "unit": "N*m"}}
    model = actuator({"schema_version": 1, **content})
    with pytest.raises(ModelError, match="the effort of a drive is not measured"):
        parity_relation(model, model.residuals["mechanical"])


@pytest.mark.parametrize("names", [[], ["drive"]])
def test_a_power_needs_junctions(names: list[str]) -> None:
    content = copy.deepcopy(STAND)
    content["residuals"]["parity_power"]["junctions"] = names
    with pytest.raises(ConfigurationError, match="is no junction"):
        actuator({"schema_version": 1, **content})
