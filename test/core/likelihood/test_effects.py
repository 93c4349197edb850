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

"""Effects of faults by differentiation, held against those worked out on paper."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict

import pytest
from support.models.fault_terms import DRIVE, EFFECTS, ELECTRICAL, MECHANICAL, RATE
from support.models.hand_relations import catalogue_effects, slope_relations
from support.observed import flea_parameters
from support.places import SHIPPED_STANDS

from flea_diag.configuration import description
from flea_diag.core.likelihood.effects import EffectRules, FaultEffect, Gains
from flea_diag.core.likelihood.plant_models import plant_models
from flea_diag.core.likelihood.symbolic_model import SymbolicModel
from flea_diag.core.symbolic.collect import monomial
from flea_diag.core.symbolic.expression import evaluate

KINEMATIC, SPEED = "parity_kinematic", "parity_speed"
K, R, KE, B, FC, LEAD = 170.0, 3.0, 165.0, 400.0, 45.0, 5e-4
P = flea_parameters(
    force_constant_n_per_a=K,
    winding_resistance_ohm=R,
    back_emf_v_s_per_m=KE,
    viscous_friction_n_s_per_m=B,
    coulomb_friction_n=FC,
    load_friction_ratio=0.05,
    reflected_mass_kg=130.0,
    current_offset_a=0.3,
    voltage_offset_v=1.2,
    drive_gain=0.9,
    drive_offset_v=0.2,
    encoder_m_per_rad=LEAD,
)
WHOLE = description.compiled_relations("actuator.yaml")
ENCODER, SLOPE = EffectRules(WHOLE), EffectRules(slope_relations())


def numbers(gains: Gains) -> dict[str, float]:
    return {name: evaluate(gain, asdict(P)) for name, gain in gains}


@pytest.mark.parametrize(
    ("rules", "channel", "gains", "rates"),
    [
        (SLOPE, "motor_current", {MECHANICAL: K, ELECTRICAL: -R}, {}),
        (SLOPE, "load_force", {MECHANICAL: -1.0}, {}),
        (SLOPE, "motor_voltage", {ELECTRICAL: 1.0, DRIVE: 1.0}, {}),
        (SLOPE, "actuator_position", {KINEMATIC: 1.0}, {MECHANICAL: -B, ELECTRICAL: -KE}),
        (ENCODER, "actuator_position", {KINEMATIC: 1.0}, {SPEED: -1.0}),
        (ENCODER, "load_position", {KINEMATIC: -1.0}, {}),
        (
            ENCODER,
            "motor_speed",
            {SPEED: LEAD, MECHANICAL: -B * LEAD, ELECTRICAL: -KE * LEAD},
            {MECHANICAL: -130.0 * LEAD},
        ),
    ],
)
def test_errors_of_readings(rules, channel, gains, rates):
    assert numbers(rules.gains(channel)) == pytest.approx(gains)
    assert numbers(rules.rates(channel)) == pytest.approx(rates)


def summed(effects: Iterable[FaultEffect]) -> dict[tuple[str, str], float]:
    """Gains that are not zero, by residual and basis signal."""
    found: dict[tuple[str, str], float] = {}
    for effect in effects:
        key = effect.residual, str(effect.basis)
        found[key] = found.get(key, 0.0) + evaluate(effect.gain, asdict(P))
    return {key: gain for key, gain in found.items() if abs(gain) > 1e-12}


@pytest.mark.parametrize(
    ("rules", "channel", "lacking"),
    [
        # The current is known from either balance, as all else in it says.
        (
            SLOPE,
            "motor_current",
            {
                (MECHANICAL, "load_force"): -1.0,
                (MECHANICAL, "direction"): -FC,
                (MECHANICAL, "fabs(load_force)*direction"): -0.05,
                (MECHANICAL, RATE): -B,
                (MECHANICAL, f"d_{RATE}"): -130.0,
                (ELECTRICAL, "motor_voltage"): 1.0,
                (ELECTRICAL, RATE): -KE,
            },
        ),
        # The voltage is 0.9 u + 0.2 by the command, its own zero 1.2, in both relations alike.
        (
            SLOPE,
            "motor_voltage",
            {
                (ELECTRICAL, "commanded_voltage"): -0.9,
                (ELECTRICAL, "1"): 1.0,
                (DRIVE, "commanded_voltage"): -0.9,
                (DRIVE, "1"): 1.0,
            },
        ),
        # A position: the second one, and the encoder through the screw.
        (ENCODER, "actuator_position", {(KINEMATIC, "load_position"): -1.0,
                                        (SPEED, "motor_speed"): LEAD}),
        # The speed: the slope of the position, also for the direction of the friction.
        (
            ENCODER,
            "motor_speed",
            {
                (SPEED, RATE): -1.0,
                (ELECTRICAL, RATE): KE,
                (MECHANICAL, RATE): B,
                (MECHANICAL, f"direction_by_{RATE}"): FC,
                (MECHANICAL, f"fabs(load_force)*direction_by_{RATE}"): 0.05,
            },
        ),
        # With the slope alone nothing tells a speed that is lost with the position.
        (SLOPE, "actuator_position", {(KINEMATIC, "load_position"): -1.0}),
    ],
)  # fmt: skip
def test_what_a_dead_reading_lacks(rules, channel, lacking):
    assert summed(rules.lost(channel)) == pytest.approx(lacking)


def model(fault: str, sizes: int, effects=EFFECTS) -> dict[tuple[str, str, int], float]:
    made = next(m for m in effects.bound(P) if m.fault == fault and len(m.sizes) == sizes)
    found: dict[tuple[str, str, int], float] = {}
    for term in made.terms:
        key = term.residual, term.regressor, term.index
        found[key] = found.get(key, 0.0) + term.gain
    return found


def test_a_shorted_winding_is_a_loss_of_resistance_and_of_both_constants():
    """R falls by 1 ohm, both constants by their whole; the current counts from its zero."""
    assert model("winding_short", 2) == pytest.approx(
        {
            (ELECTRICAL, "motor_current", 0): -1.0,
            (ELECTRICAL, RATE, 1): -KE,
            (MECHANICAL, "motor_current", 1): K,
        }
    )


def test_a_jam_drags_with_the_direction_the_speed_and_the_load():
    assert model("jam", 3) == {
        (MECHANICAL, "direction", 0): 1.0,
        (MECHANICAL, RATE, 1): 1.0,
        (MECHANICAL, "fabs(load_force)*direction", 2): 1.0,
    }
    assert model("jam", 1) == {(MECHANICAL, "fabs(motor_current)*direction", 0): K}


def test_an_open_winding_drops_no_voltage_and_the_drive_reads_nearer_to_its_command():
    assert model("winding_open", 2) == pytest.approx(
        {
            (ELECTRICAL, "motor_voltage", 0): 1.0,
            (ELECTRICAL, RATE, 0): -KE,
            (DRIVE, "commanded_voltage", 1): 0.9,
        }
    )


def test_a_motor_without_torque_has_no_back_emf_either():
    (torqueless,) = [
        m.terms
        for m in catalogue_effects(WHOLE).bound(P)
        if m.fault == "motor_failure" and any(t.residual == MECHANICAL for t in m.terms)
    ]
    assert {(t.residual, t.regressor): t.gain for t in torqueless} == pytest.approx(
        {(ELECTRICAL, "motor_speed"): -KE * LEAD, (MECHANICAL, "motor_current"): K}
    )


def test_units_differ_as_the_relations_say():
    found = {
        (u.residual, u.difference, u.regressor): u.gain for u in EFFECTS.basis_of(P).unit_terms
    }
    slow = {key: gain for key, gain in found.items() if key[0] in (MECHANICAL, ELECTRICAL)}
    assert slow == pytest.approx(
        {
            (MECHANICAL, "coulomb_friction_n", "direction"): -1.0,
            (MECHANICAL, "viscous_friction_n_s_per_m", RATE): -1.0,
            (ELECTRICAL, "winding_resistance_ohm", "motor_current"): -1.0,
            (ELECTRICAL, "back_emf_v_s_per_m", RATE): -1.0,
            (ELECTRICAL, "voltage_offset_v", "one"): -1.0,
        }
    )


def test_a_fault_that_shows_in_vibration_alone_adds_its_least_drag():
    made = EFFECTS.bound(P, is_vibration_only=True)
    assert {m.fault for m in made} == {"jam", "spall", "ball_nut_friction"}
    lows = {(m.fault, s.name): s.low for m in made for s in m.sizes}
    assert lows[("jam", "coulomb drag")] == pytest.approx(0.5 * FC)
    assert lows[("jam", "viscous drag")] == 0.0
    assert lows[("ball_nut_friction", "viscous drag")] == pytest.approx(0.3 * B)
    assert [m.sizes[0].high for m in made if m.fault == "spall"] == [20.0, 0.0]
    assert [m.sizes[0].high for m in EFFECTS.bound(P) if m.fault == "spall"] == [20.0]


@pytest.mark.parametrize("name", ["ema", "wing"])
@pytest.mark.parametrize("lacking", ["", "motor_speed"])
def test_without_its_supply_a_turning_motor_reads_its_back_emf(name: str, lacking: str) -> None:
    """Without a reading of its speed by the rate of the position, whose lead nothing tells."""
    _, coasting = supply_open(name, *([lacking] if lacking else ()))
    readings = {"commanded_voltage": 20.0, "motor_speed": -300.0}
    readings |= {"d_actuator_position": LEAD * -300.0, "d_load_position": LEAD * -300.0}
    added = sum(evaluate(e.gain * e.basis, asdict(P) | readings) for e in coasting.effects)
    assert {e.residual for e in coasting.effects} == {DRIVE}
    # The terminals read KE w; the relation expects 0.9 of the command.
    assert added == pytest.approx(KE * LEAD * -300.0 - 0.9 * 20.0)


def test_what_a_drag_is_made_of_and_nothing_reads_is_left_out() -> None:
    _, coasting = supply_open("wing", "motor_speed", "actuator_position")
    assert [str(effect.basis) for effect in coasting.effects] == ["commanded_voltage"]


def supply_open(name: str, *lacking: str) -> tuple[SymbolicModel, ...]:
    """Models of an open supply on a stand without these channels."""
    actuator, faults = (SHIPPED_STANDS[name] / f"{each}.yaml" for each in ("actuator", "faults"))
    known = description.described(actuator)
    channels = tuple(each for each in (*known.sensors, *known.inputs) if each not in lacking)
    has_encoder = "motor_speed" not in lacking
    relations = description.compiled_relations(actuator, channels, has_encoder)
    fault = description.faults_of(actuator, faults)["supply_open"]
    return tuple(plant_models(fault, EffectRules(relations)))


def test_a_rate_that_is_added_to_a_prediction_runs_away_from_it() -> None:
    """Faster by r K/s: r times the time of correction when it is seen, and r t more after it."""
    found = {str(e.basis): e for e in ENCODER.added("motor_temperature", monomial("1"))}
    assert {e.residual for e in found.values()} == {"motor_temperature"}
    assert {name: evaluate(e.gain, {}) for name, e in found.items()} == {
        "1": 15.0,
        "elapsed_s": 1.0,
    }
    assert SLOPE.added("no_such_residual", monomial("1")) == ()


def heated(stand: str, parameter: str, lacking: str = "") -> dict[tuple[str, str], float]:
    """What a parameter that is twice as large adds, in the numbers of the description."""
    path = SHIPPED_STANDS[stand] / "actuator.yaml"
    known = description.described(path)
    channels = tuple(name for name in (*known.sensors, *known.inputs) if name != lacking)
    relations = description.compiled_relations(path, channels)
    found: dict[tuple[str, str], float] = {}
    for effect in EffectRules(relations).scaled({parameter: 1.0}):
        key = effect.residual, str(effect.basis)
        found[key] = evaluate(effect.gain, relations.described)
    return found


def test_a_resistance_that_no_voltage_shows_heats_by_its_own_loss() -> None:
    """R I^2 / C at the operating point of the elbow: 0.75 ohm, 1.8 A, 450 J/K."""
    rate = 0.75 * 1.8**2 / 450.0
    assert heated("joint", "winding_resistance", lacking="motor_voltage") == pytest.approx(
        {("motor_temperature", "1"): 15.0 * rate, ("motor_temperature", "elapsed_s"): rate}
    )
    (only,) = heated("joint", "winding_resistance")
    assert only == (ELECTRICAL, "motor_current")


def test_lost_cooling_heats_by_what_a_warm_motor_gives_away() -> None:
    """At rest that is all that heats it, R I^2: 2.95 ohm and 1 A in 300 J/K of the FLEA."""
    rate = 2.95 * 1.0**2 / 300.0
    assert heated("flea", "housing_ambient_resistance") == pytest.approx(
        {("motor_temperature", "1"): 15.0 * rate, ("motor_temperature", "elapsed_s"): rate}
    )
    assert heated("joint", "motor_capacity", lacking="motor_voltage")["motor_temperature", "1"] < 0
