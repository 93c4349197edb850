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

"""Advice on tests: what is expected of each, held against trials of the same tests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.models.fault_terms import (
    BASIS,
    BIAS,
    DRAG,
    EFFECTS,
    LOAD,
    RESIDUALS,
    SIGMA,
    SPACING,
    TOLERANCE,
)
from support.models.hand_relations import catalogue_effects
from support.observed import flea_parameters
from support.places import ROOT

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.configuration.description import compiled_relations
from flea_diag.configuration.stand import load_stand
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.choice.next_test import (
    LikelihoodTest,
    StandTest,
    Suspect,
    feature_tests,
    motion_tests,
    next_tests,
)
from flea_diag.core.choice.planned_motion import (
    MOTIONS,
    PlannedMotion,
    motions_within,
    planned,
)
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.likelihood import NormalEquations

P = flea_parameters()
DROP_NATS = 3.5
MODELS = (DRAG, BIAS, LOAD)
SHORT = PlannedMotion("to and fro", 0.03, 4.0, 100.0, 4.0)
TRUE_SIZES = {"drag": (40.0, 100.0), "bias": (0.3,), "load": (40.0, 0.0)}
TEST = LikelihoodTest(MODELS, SIGMA, SPACING, TOLERANCE, DROP_NATS)


def window(model: FaultModel, phi: np.ndarray, random: np.random.Generator) -> NormalEquations:
    """Noisy residuals of a fault over a window; as coloured as the likelihood takes it."""
    at = {name: place for place, name in enumerate(BASIS.names)}
    evidence = NormalEquations(RESIDUALS, BASIS)
    rows = {}
    for name in RESIDUALS:
        effect = sum(
            TRUE_SIZES[model.fault][t.index] * t.gain * phi[:, at[t.regressor]]
            for t in model.terms
            if t.residual == name
        )
        hold = int(SPACING[name])
        noise = np.repeat(random.normal(0.0, SIGMA[name], len(phi) // hold + 1), hold)
        rows[name] = effect + noise[: len(phi)]
    evidence.add(np.column_stack([rows[name] for name in RESIDUALS]), phi)
    return evidence


def suspects(evidence: NormalEquations, *models: FaultModel) -> list[Suspect]:
    fits = evidence.fit(models, SIGMA, SPACING, TOLERANCE)
    best = max(fit.log_likelihood for fit in fits)
    weights = [math.exp(fit.log_likelihood - best) for fit in fits]
    return [
        Suspect(fit.fault, weight / sum(weights), fit)
        for fit, weight in zip(fits, weights, strict=True)
    ]


def test_the_expected_size_is_what_trials_of_the_test_give() -> None:
    """Drag against a load bias, after motion one way only; then the planned motion, 60 times."""
    random = np.random.default_rng(5)
    one_way = planned(EFFECTS, P, PlannedMotion("out", 0.03, 4.0, 100.0, 0.6))
    before = window(DRAG, one_way, random)
    group = suspects(before, DRAG, LOAD)
    (foreseen,) = motion_tests(group, before, TEST, EFFECTS, P, motions=(SHORT,))
    left = []
    for _ in range(60):
        after = window(DRAG, np.vstack([one_way, planned(EFFECTS, P, SHORT)]), random)
        fits = after.fit((DRAG, LOAD), SIGMA, SPACING, TOLERANCE)
        best = max(fit.log_likelihood for fit in fits)
        left.append(sum(best - fit.log_likelihood <= DROP_NATS for fit in fits))
    assert foreseen.expected_size < 1.5
    assert np.mean(left) == pytest.approx(foreseen.expected_size, abs=0.25)
    assert foreseen.splits == (("drag", "load"),)


def test_faults_of_one_and_the_same_model_are_split_by_no_motion() -> None:
    twin = FaultModel("twin", DRAG.sizes, DRAG.terms)
    evidence = window(DRAG, planned(EFFECTS, P, SHORT), np.random.default_rng(1))
    fit, same = evidence.fit((DRAG, twin), SIGMA, SPACING, TOLERANCE)
    group = [Suspect("drag", 0.5, fit), Suspect("twin", 0.5, same)]
    test = LikelihoodTest((DRAG, twin), SIGMA, SPACING, TOLERANCE, DROP_NATS)
    assert motion_tests(group, evidence, test, EFFECTS, P) == ()


def test_a_fault_without_a_model_is_neither_dropped_nor_predicted() -> None:
    evidence = window(DRAG, planned(EFFECTS, P, SHORT), np.random.default_rng(1))
    (fit,) = evidence.fit((DRAG,), SIGMA, SPACING, TOLERANCE)
    group = [Suspect("drag", 0.5, fit), Suspect("spall", 0.5)]
    assert motion_tests(group, evidence, TEST, EFFECTS, P) == ()


def test_foreseen_evidence_is_that_of_the_samples_without_noise() -> None:
    phi = planned(EFFECTS, P, SHORT)
    evidence = window(BIAS, planned(EFFECTS, P, MOTIONS[0]), np.random.default_rng(2))
    foreseen = evidence.foreseen(phi, BIAS, (0.3,))
    at = {name: place for place, name in enumerate(BASIS.names)}
    for row in phi:
        values = [
            sum(0.3 * t.gain * row[at[t.regressor]] for t in BIAS.terms if t.residual == name)
            for name in RESIDUALS
        ]
        evidence.add(np.array([values]), row[np.newaxis])
    both = [e.fit(MODELS, SIGMA, SPACING, TOLERANCE) for e in (evidence, foreseen)]
    for one, two in zip(*both, strict=True):
        assert one.log_likelihood == pytest.approx(two.log_likelihood, rel=1e-6)


@pytest.mark.parametrize("lead", [0.0, 5e-4])
def test_planned_signals_obey_newton_and_kirchhoff(lead: float) -> None:
    """A unit with offsets: basis signals are true values, the zero of the channels taken off."""
    p = replace(P, encoder_m_per_rad=lead, current_offset_a=0.3, voltage_offset_v=1.5)
    effects = catalogue_effects(compiled_relations("actuator.yaml", has_encoder=bool(lead)))
    phi = dict(zip(effects.names, planned(effects, p, SHORT).T, strict=True))
    per_m_s = 1.0 / lead if lead else 1.0
    speed = phi["motor_speed" if lead else "d_actuator_position"] / per_m_s
    acceleration = phi["d_motor_speed" if lead else "d_d_actuator_position"] / per_m_s
    force = p.force_constant_n_per_a * phi["motor_current"] - phi["load_force"]
    drag = p.coulomb_friction_n * phi["direction"] + p.viscous_friction_n_s_per_m * speed
    assert np.abs(force - drag - p.reflected_mass_kg * acceleration).max() < 1e-6
    drop = p.winding_resistance_ohm * phi["motor_current"] + p.back_emf_v_s_per_m * speed
    assert np.abs(phi["motor_voltage"] - drop).max() < 1e-9
    assert np.abs(phi["commanded_voltage"] - phi["motor_voltage"] - 1.5).max() < 1e-9
    assert speed.max() == pytest.approx(0.03)
    assert np.gradient(speed, 0.01) == pytest.approx(acceleration, abs=1e-3)
    assert phi["load_position"] == pytest.approx(phi["actuator_position"])


TABLE = FaultFeatureTable.from_mapping(
    {
        "title": "two faults",
        "provenance": "worked by hand",
        "alphabet": ["0", "1"],
        "features": {
            "accelerometer_1_rms": {"cost": 1.0},
            "accelerometer_2_rms": {"cost": 1.0},
            "accelerometer_2_crest": {"cost": 1.0},
        },
        "faults": {
            "a": {
                "accelerometer_1_rms": {"0": 0.5, "1": 0.5},
                "accelerometer_2_rms": {"0": 1.0, "1": 0.0},
                "accelerometer_2_crest": {"0": 0.5, "1": 0.5},
            },
            "b": {
                "accelerometer_1_rms": {"0": 0.5, "1": 0.5},
                "accelerometer_2_rms": {"0": 0.0, "1": 1.0},
                "accelerometer_2_crest": {"0": 0.0, "1": 1.0},
            },
        },
    },
    "test",
)
PAIR = [Suspect("a", 0.6), Suspect("b", 0.4)]
AXES = ("accelerometer_1_x", "accelerometer_2_x")


def test_features_by_hand() -> None:
    """Rms of 2 tells a from b; crest of 2: 0 (0.3) leaves a, 1 (0.7) leaves both: 1.7."""
    here, missing = feature_tests(PAIR, TABLE, AXES)
    assert {t.what: t.expected_size for t in here} == pytest.approx(
        {"accelerometer_2_rms": 1.0, "accelerometer_2_crest": 1.7}
    )
    assert {t.splits for t in here} == {(("a", "b"),)}
    assert missing == ()
    assert [t.what for t in feature_tests(PAIR, TABLE, AXES, ("accelerometer_2_rms",))[0]] == [
        "accelerometer_2_crest"
    ]


def test_a_sensor_that_is_missing_is_named_with_what_it_would_leave() -> None:
    here, (sensor,) = feature_tests(PAIR, TABLE, ())
    assert here == ()
    assert (sensor.kind, sensor.what, sensor.expected_size) == ("sensor", "accelerometer_2", 1.0)
    assert math.isnan(sensor.seconds)


def test_the_most_gained_for_each_second_comes_first_and_sensors_last() -> None:
    split = (("a", "b"),)
    slow = StandTest("motion", "slow", 8.0, 1.0, split)
    quick = StandTest("feature", "quick", 1.0, 1.5, split)
    sensor = StandTest("sensor", "accelerometer_2", math.nan, 1.0, split)
    assert next_tests(PAIR, (slow,), (quick,), (sensor,)) == (quick, slow)
    assert next_tests(PAIR, (), (), (sensor,)) == (sensor,)


@pytest.mark.slow
def test_an_unsplit_group_of_a_recorded_bag_gets_advice() -> None:
    """Without accelerometers a jam and a dry nut are alike in every signal, by design."""
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.configuration.stand import load_stand
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Outcome, Scan

    pipeline, groups = make_pipeline(load_stand()), []
    folder = ROOT / "bags" / "unit_switch_jam"
    for part in BagReader(folder).blocks((ChannelTable, Scan)):
        many = isinstance(part, ScanBlock)
        caused = pipeline.handle_block(part) if many else pipeline.handle(part)
        groups += [r for r in caused if isinstance(r, AmbiguityGroup)]
    last = groups[-1]
    assert ": z = " in last.opened_by
    assert ", limit " in last.opened_by
    assert last.outcome is Outcome.INDISTINGUISHABLE
    assert last.next_tests[0].kind == "sensor"
    assert last.next_tests[0].what == "accelerometer_2"
    assert last.next_tests[0].expected_size < len(last.members)


@pytest.mark.parametrize("stand", ["ema", "joint"])
def test_motions_stay_within_what_the_calibration_has_seen(stand: str) -> None:
    files = load_stand(stand)
    calibration = load_calibration(files.calibration)
    known = compiled_relations(files.actuator, calibration.channels).residuals
    ranges = calibration.envelope.ranges
    motions = motions_within(known, calibration.envelope, calibration.period_s)
    assert len(motions) == (6 if known.load else 2)
    for motion in motions:
        reach = motion.peak_m_s * motion.period_s / (2.0 * math.pi)
        low, high = ranges[known.position]
        assert low < motion.middle_m - reach < motion.middle_m + reach < high
        assert motion.peak_m_s < max(ranges[f"d_{known.position}"])
        assert motion.scan_s == calibration.period_s
        if motion.load_n:
            assert ranges[known.load][0] < motion.load_n < ranges[known.load][1]
            assert motion.name.endswith(f"load {motion.load_n:.3g} N")


def test_without_an_envelope_they_are_those_of_the_flea() -> None:
    known = compiled_relations(load_stand().actuator).residuals
    assert motions_within(known, None, 0.01) == MOTIONS
