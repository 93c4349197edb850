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

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import stands

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.knowledge import knowledge
from flea_diag.configuration.stand import load_stand
from flea_diag.core.causal_graph.operating_point import QUADRANTS
from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.likelihood.fit import Fit

OUT = (QUADRANTS[0],)
BOTH = (QUADRANTS[0], QUADRANTS[2])


def fresh() -> Isolation:
    known = stands.knowledge()
    return Isolation(known.faults, known.signatures, known.effects.residuals.symptoms)


def alive(isolation: Isolation) -> set[str]:
    return {h.name for h in isolation.alive()}


# Residual, sign, quadrants -> some that must stay and some that must go (motoring out: i, v > 0).
ROWS = [
    (
        "parity_mechanical_dn",
        "+",
        BOTH,
        {"jam", "ball_nut_friction", "spall"},
        {"winding_open", "motor_temperature_bias", "nut_temperature_drift"},
    ),
    ("parity_mechanical_dn", "-", BOTH, {"load_force_bias"}, {"jam", "ball_nut_friction"}),
    ("parity_mechanical", "+", OUT, {"jam", "motor_current_bias"}, {"supply_open"}),
    ("parity_mechanical", "-", (QUADRANTS[2],), {"jam"}, {"winding_open"}),
    (
        "parity_electrical",
        "-",
        OUT,
        {"winding_short", "motor_current_bias", "motor_voltage_bias"},
        {"jam", "winding_open", "load_force_bias"},
    ),
    ("parity_electrical", "+", OUT, {"winding_open", "motor_voltage_bias"}, {"jam"}),
    (
        "motor_temperature",
        "+",
        OUT,
        {"motor_temperature_bias", "motor_temperature_drift"},
        {"motor_voltage_bias", "nut_temperature_bias"},
    ),
    (
        "ambient_temperature",
        "-",
        OUT,
        {"ambient_temperature_bias", "ambient_temperature_dead"},
        {"jam", "motor_temperature_bias"},
    ),
    (
        "actuator_position",
        "+",
        OUT,
        {"actuator_position_bias", "actuator_position_dead", "actuator_position_scaling"},
        {"jam", "actuator_position_drift", "motor_current_bias"},
    ),
    (
        "motor_current_noise",
        "+",
        OUT,
        {"motor_current_noise", "motor_current_dropout"},
        {"jam", "motor_current_dead", "motor_current_bias", "load_force_noise"},
    ),
    (
        "motor_temperature_stuck",
        "+",
        OUT,
        {"motor_temperature_dead"},
        {"motor_temperature_dropout", "motor_temperature_bias", "motor_current_dead", "jam"},
    ),
    (
        "motor_current_dropout",
        "+",
        OUT,
        {"motor_current_dropout"},
        {"motor_current_noise", "motor_current_dead", "load_force_dropout"},
    ),
    ("motor_current_noise", "-", OUT, {"motor_current_dead"}, {"motor_current_noise", "jam"}),
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=[f"{r[0]}{r[1]}{len(r[2])}" for r in ROWS])
def test_a_first_symbol_keeps_what_predicts_it_and_drops_the_rest(row):
    residual, sign, quadrants, stay, go = row
    isolation = fresh()
    isolation.observe(5, residual, sign, "?", quadrants)
    assert stay <= alive(isolation)
    assert not go & alive(isolation)


def test_every_hypothesis_carries_the_evidence():
    isolation = fresh()
    isolation.observe(5, "parity_mechanical_dn", "+", "?", BOTH)
    for hypothesis in isolation.hypotheses.values():
        (check,) = hypothesis.checks
        assert (check.stamp_ns, check.source) == (5, "parity_mechanical_dn")
        assert check.observed == "+?"
        assert check.words
        assert check.kept is (hypothesis.why_dropped == "")
    jam = isolation.hypotheses["jam"]
    assert jam.checks[0].predicted
    assert jam.checks[0].path
    assert "screw_coulomb_friction+" in jam.fault.deviation
    assert isolation.hypotheses["rotor_eccentricity"].fault.deviation == "vibration only"
    dropped = isolation.hypotheses["winding_open"]
    assert dropped.why_dropped.startswith("parity_mechanical_dn: ")


def test_a_normal_residual_drops_nothing():
    isolation = fresh()
    isolation.observe(5, "parity_electrical", "0", "?", OUT)
    physical = {name for name, fault in stands.knowledge().faults.items() if fault.alternatives}
    assert physical <= alive(isolation)


def test_the_dropped_stay_dropped_and_keep_their_first_reason():
    isolation = fresh()
    isolation.observe(5, "parity_electrical", "+", "?", OUT)
    reason = isolation.hypotheses["jam"].why_dropped
    isolation.observe(6, "parity_mechanical", "+", "?", OUT)
    assert isolation.hypotheses["jam"].why_dropped == reason
    assert len(isolation.hypotheses["jam"].checks) == 1


SYMBOLS = st.tuples(
    st.sampled_from(
        ("parity_mechanical", "parity_mechanical_dn", "parity_electrical", "motor_temperature",
         "actuator_position", "motor_current_noise", "ambient_temperature")
    ),
    st.sampled_from("+-0"),
    st.sampled_from("+-0?"),
    st.booleans(),
)  # fmt: skip


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.lists(SYMBOLS, max_size=6))
def test_the_group_only_shrinks_and_probabilities_sum_to_one(symbols):
    isolation = fresh()
    before = alive(isolation)
    for stamp, (residual, magnitude, slope, settled) in enumerate(symbols):
        isolation.observe(stamp, residual, magnitude, slope, BOTH, settled)
        now = alive(isolation)
        assert now <= before
        assert now or not (settled and before)
        assert len(now) + len(isolation.dropped()) == len(stands.knowledge().faults)
        if now:
            assert sum(h.probability for h in isolation.alive()) == pytest.approx(1.0)
        before = now


def test_a_symbol_against_all_that_is_left_is_overruled_once_settled():
    for settled in (False, True):
        isolation = fresh()
        isolation.observe(1, "parity_mechanical_dn", "+", "?", BOTH)
        isolation.apply_likelihoods(
            2, [Fit(n, 50.0 * (n == "jam"), (1.0,)) for n in alive(isolation)], 5
        )
        assert alive(isolation) == {"jam"}
        isolation.observe(3, "motor_temperature_noise", "+", "?", BOTH, settled)
        assert alive(isolation) == ({"jam"} if settled else set())
        last = isolation.hypotheses["jam"].checks[-1]
        assert last.observed == "+?"
        assert ("contradicts all remaining faults, not used for rejection" in last.words) is settled


def test_likelihood_drops_what_is_far_behind_and_ranks_the_rest():
    isolation = fresh()
    isolation.observe(1, "parity_mechanical_dn", "+", "?", BOTH)
    gains = {"jam": 40.0, "ball_nut_friction": 38.0, "load_force_bias": 10.0}
    fits = [Fit(name, gain, (80.0,)) for name, gain in gains.items()]
    isolation.apply_likelihoods(2, [*fits, Fit("jam", 12.0, (1.0,))], 5.0)
    names = [h.name for h in isolation.alive()]
    assert names[:2] == ["jam", "ball_nut_friction"]
    assert isolation.hypotheses["jam"].log_likelihood == 40.0
    odds = (
        isolation.hypotheses["jam"].probability
        / isolation.hypotheses["ball_nut_friction"].probability
    )
    assert odds == pytest.approx(7.389, rel=1e-3)
    why = isolation.hypotheses["load_force_bias"].why_dropped
    assert "30.0 nats below the most likely fault (limit 5.0)" in why
    # A fault without a quantitative model is neither favoured nor dropped.
    assert "backlash" not in gains
    assert isolation.hypotheses["backlash"].fit is None


def test_faults_defined_by_a_symptom_go_when_it_stays_out():
    isolation = fresh()
    isolation.require(9, {}, ())
    assert not {"motor_current_noise", "motor_temperature_dead", "nut_temperature_dropout"} & alive(
        isolation
    )
    assert {"jam", "motor_current_bias", "actuator_position_dead"} <= alive(isolation)
    isolation.require(10, {}, ("actuator_position",))
    assert "actuator_position_dead" not in alive(isolation)
    assert "still follows the motion" in isolation.hypotheses["actuator_position_dead"].why_dropped


def of_joint(repeats: int) -> Isolation:
    """The joint's temperature is read twice a second and held in between: a healthy reading."""
    joint = load_stand("joint")
    learned = load_calibration(joint.calibration)
    slow = [limit.channel == "motor_temperature" for limit in learned.sensors]
    sensors = tuple(
        replace(limit, repeats=repeats, every=50 if repeats else 1) if is_slow else limit
        for limit, is_slow in zip(learned.sensors, slow, strict=True)
    )
    known = knowledge(joint, replace(learned, sensors=sensors))
    return Isolation(known.faults, known.signatures, known.symptoms)


def test_a_death_that_no_test_can_show_is_not_dropped_for_showing_nothing():
    isolation = of_joint(repeats=0)
    isolation.require(9, {}, ())
    assert "motor_temperature_dead" in alive(isolation)
    assert not {"motor_current_dead", "motor_temperature_noise"} & alive(isolation)
    assert stands.knowledge().symptoms.death_unseen == ()


def test_a_death_that_takes_nine_slow_readings_to_show_is_not_dropped_sooner():
    isolation = of_joint(repeats=450)
    isolation.require(9, {}, (), followed_s=4.4)
    assert "motor_temperature_dead" in alive(isolation)
    assert "motor_current_dead" not in alive(isolation)
    isolation.require(10, {}, (), followed_s=4.6)
    assert "motor_temperature_dead" not in alive(isolation)


def test_faults_defined_by_a_symptom_stay_when_it_shows():
    isolation = fresh()
    seen = ("motor_current_noise", "load_force_dropout", "nut_temperature_stuck")
    symbols = dict.fromkeys(seen, "+") | {"motor_temperature_noise": "-"}
    isolation.require(9, symbols, ())
    kept = {"motor_current_noise", "load_force_dropout", "motor_temperature_dead"}
    assert {*kept, "nut_temperature_dead"} <= alive(isolation)
    gone = {"motor_current_dead", "motor_current_dropout", "load_force_noise"}
    assert not gone & alive(isolation)


@pytest.mark.parametrize(
    ("deviating", "waits"), [("motor_temperature", False), ("actuator_position", True)]
)
def test_noise_that_stays_out_is_ruled_out_early_but_where_a_reading_jumped(deviating, waits):
    isolation = fresh()
    isolation.require(9, {deviating: "+"}, (), settled=False)
    assert not {"load_force_noise", "motor_temperature_dropout"} & alive(isolation)
    assert ("actuator_position_noise" in alive(isolation)) is waits
    # To be quiet, or held, takes longer; to go on moving speaks against a dead sensor at once.
    assert {"motor_temperature_dead", "actuator_position_dead"} <= alive(isolation)
    isolation.require(10, {deviating: "+"}, ("actuator_position",), settled=False)
    assert "actuator_position_dead" not in alive(isolation)
    isolation.require(11, {deviating: "+"}, ())
    assert not {"motor_temperature_dead", "actuator_position_noise"} & alive(isolation)


def test_a_feature_leaves_what_it_names():
    isolation = fresh()
    isolation.update(3, "accelerometer_2_std", "1", {"jam": 0.7, "spall": 0.3})
    assert [(h.name, h.probability) for h in isolation.alive()] == [("jam", 0.7), ("spall", 0.3)]
    check = isolation.hypotheses["winding_short"].checks[-1]
    assert (check.source, check.observed, check.kept) == ("accelerometer_2_std", "1", False)


@pytest.mark.parametrize(("ratio", "left"), [(3.6e6, True), (100.0, False)])
def test_of_a_very_large_likelihood_ratio_a_few_nats_drop_no_fault(ratio, left):
    isolation = fresh()
    isolation.observe(1, "parity_mechanical_dn", "+", "?", BOTH)
    fits = [
        Fit(name, gain, (80.0,), (5.0,))
        for name, gain in (("jam", ratio), ("ball_nut_friction", ratio - 7.0))
    ]
    isolation.apply_likelihoods(2, fits, 3.5)
    assert ("ball_nut_friction" in alive(isolation)) is left


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("load_force_bias", "load_force_scaling"), True),
        (("load_force_bias", "jam"), False),
        (("load_force_drift",), False),
        ((), False),
    ],
)
def test_a_group_begins_with_a_jump_where_each_of_it_does(names, expected):
    isolation = fresh()
    for hypothesis in isolation.alive():
        if hypothesis.name not in names:
            hypothesis.why_dropped = "for this test"
    assert isolation.begins_with_jump is expected


@pytest.mark.slow
def test_a_position_may_step_by_a_play_between_it_and_the_other_one():
    """A gap that opens under load moves the load side at once, by a fault of no sensor."""
    machine = load_stand("ema")
    known = knowledge(machine, load_calibration(machine.calibration))
    isolation = Isolation(known.faults, known.signatures, known.effects.residuals.symptoms)
    isolation.observe(0, "load_position", "+", "?", BOTH)
    left = alive(isolation)
    assert {"backlash", "load_position_bias"} <= left
    assert not left & {"jam", "actuator_position_bias", "winding_short"}
