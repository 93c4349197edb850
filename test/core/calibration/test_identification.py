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
from functools import partial

import numpy as np
import pytest
from scipy import optimize
from support import stands
from support.models import linear_ema as ema

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.identification import identify
from flea_diag.core.calibration.robust_regression import fitted_by_fold, robust_fit
from flea_diag.errors import CalibrationError

TRUE = {
    "force_constant_n_per_a": 170.0,
    "back_emf_v_s_per_m": 170.0,
    "winding_resistance_ohm": 3.1,
    "current_offset_a": 0.25,
    "voltage_offset_v": -0.8,
    "coulomb_friction_n": 60.0,
    "viscous_friction_n_s_per_m": 500.0,
    "reflected_mass_kg": 120.0,
    "encoder_m_per_rad": 5e-4,
    "drive_gain": 1.0,
    "drive_offset_v": -0.8,
    "motor_heating_k_per_a2s": 0.0098,
}
# Reversals inside the smoothing window tilt friction and mass by a few per cent.
SMOOTHED = {
    "coulomb_friction_n": 0.06,
    "viscous_friction_n_s_per_m": 0.15,
    "reflected_mass_kg": 0.06,
    "winding_resistance_ohm": 0.01,
    "motor_heating_k_per_a2s": 0.35,
}


def runs(channels: tuple[str, ...] = ema.CHANNELS, columns=None) -> list[NominalRun]:
    columns = columns or ema.nominal_runs()
    return [NominalRun(f"run{n}", ema.rows(each, channels)) for n, each in enumerate(columns)]


def relations_of(channels: tuple[str, ...]):
    return partial(compiled_relations, "actuator.yaml", channels)


def found(columns=None, channels: tuple[str, ...] = ema.CHANNELS):
    return identify(runs(channels, columns), relations_of(channels), 31, 0.01)


@pytest.mark.parametrize("channels", [ema.CHANNELS, ema.STAND])
def test_the_true_parameters_are_found_within_their_standard_errors(channels):
    result = found(channels=channels)
    lacking = set(result.not_identified) - {"winding_inductance_h"}
    expected = {"encoder_m_per_rad", "drive_gain", "drive_offset_v", "position_offset_m"}
    assert expected <= lacking if channels == ema.STAND else not expected & lacking
    for name, true in TRUE.items():
        if name in result.not_identified:
            continue
        value, sigma = getattr(result.parameters, name), result.sigmas.get(name, 0.0)
        slack = 4 * sigma + SMOOTHED.get(name, 0.002) * abs(true)
        assert value == pytest.approx(true, abs=slack), name


def test_bad_voltage_does_not_draw_the_fit():
    random = np.random.default_rng(8)
    columns = []
    for each in ema.nominal_runs():
        voltage = each["motor_voltage"].copy()
        # Four tenths of each run read the supply, in stretches of 1 to 3 s.
        while np.mean(voltage == -24.0) < 0.4:
            start = random.integers(0, len(voltage) - 300)
            voltage[start : start + random.integers(100, 300)] = -24.0
        columns.append({**each, "motor_voltage": voltage})
    clean, spoilt = found(), found(columns)
    for name in ("winding_resistance_ohm", "back_emf_v_s_per_m", "voltage_offset_v"):
        expected = getattr(clean.parameters, name)
        assert getattr(spoilt.parameters, name) == pytest.approx(expected, rel=0.03), name
    assert 4.0 < spoilt.voltage_limit_v < 15.0


def test_a_fit_without_each_recording_is_the_fit_of_the_others():
    random = np.random.default_rng(4)
    A, fold = random.standard_normal((400, 3)), np.repeat(np.arange(4), 100)
    y = A @ [1.0, -2.0, 0.5] + 0.1 * random.standard_normal(400)
    weight = random.uniform(0.2, 1.0, 400)
    fits = fitted_by_fold(A, y, weight, fold, 4, 1.0)
    for number in range(4):
        for x, part in ((fits.without, fold != number), (fits.alone, fold == number)):
            W = weight[part, None]
            again = np.linalg.lstsq(A[part] * W, y[part] * W[:, 0], rcond=None)[0]
            np.testing.assert_allclose(x[number], again, rtol=1e-9)


def test_the_error_of_a_unit_alone_is_that_of_least_squares_and_infinite_where_it_fixes_nothing():
    random = np.random.default_rng(5)
    A, fold = random.standard_normal((2000, 2)), np.repeat(np.arange(2), 1000)
    A[fold == 1, 1] = A[fold == 1, 0]  # only the sum of the two shows
    y = A @ [1.0, -2.0] + 0.1 * random.standard_normal(2000)
    of_one, of_other = fitted_by_fold(A, y, np.ones(2000), fold, 2, 4.0).covariance
    # Four rows to one independent row: 0.01 / (1000 / 4) for each regressor of unit variance.
    np.testing.assert_allclose(np.diag(of_one), 4e-5, rtol=0.15)
    assert np.isinf(of_other).all()


def test_every_recording_has_the_parameters_that_the_others_give():
    result = found()
    columns = list(ema.nominal_runs())
    again = found(columns[1:]).parameters
    judged = result.judging(0).parameters
    for name in ("winding_resistance_ohm", "back_emf_v_s_per_m", "force_constant_n_per_a"):
        # At the weights of the whole fit: less than a standard error from a fit of the others.
        slack = result.sigmas[name]
        assert getattr(judged, name) == pytest.approx(getattr(again, name), abs=slack)
        assert getattr(judged, name) != getattr(result.parameters, name)


def test_runs_without_motion_are_refused():
    still = ema.run(reference=lambda t: 0.0)
    with pytest.raises(CalibrationError, match=r"s of motion above.*record the actuator while"):
        found([ema.noisy(still, n) for n in range(3)])


def test_without_a_width_of_friction_nothing_says_what_is_motion():
    known = compiled_relations("actuator.yaml", ema.CHANNELS)
    described = {n: v for n, v in known.described.items() if n != "stribeck_speed_m_s"}
    with pytest.raises(CalibrationError, match=r"stribeck_speed_m_s.*add it to base_parameters"):
        identify(runs(), lambda _: replace(known, described=described), 31, 0.01)


def test_a_load_of_the_wrong_sign_is_refused():
    flipped = [{**each, "load_force": -each["load_force"]} for each in ema.nominal_runs()]
    with pytest.raises(CalibrationError, match="motor_current or load_force has the wrong sign"):
        found(flipped)


def test_runs_shorter_than_the_window_are_refused():
    with pytest.raises(CalibrationError, match="no recording is as long as"):
        identify([NominalRun("short", np.zeros((30, 10)))], relations_of(ema.CHANNELS), 31, 0.01)


def test_without_voltage_only_what_needs_it_is_missing():
    channels = tuple(c for c in ema.STAND if c != "motor_voltage")
    result = found(channels=channels)
    assert result.not_identified["winding_resistance_ohm"] == "no motor_voltage channel"
    assert result.parameters.force_constant_n_per_a == pytest.approx(170.0, rel=0.01)


def test_huber_agrees_with_a_general_minimiser():
    random = np.random.default_rng(3)
    A = np.stack((random.standard_normal(400), np.ones(400)), axis=1)
    y = A @ (2.0, -1.0) + 0.1 * random.standard_normal(400)
    y[:40] += 0.5 * random.random(40)
    x, covariance, weight = robust_fit(A, y, np.arange(400) // 50)
    reference = optimize.least_squares(lambda b: (A @ b - y) / (2 * 0.1), (0, 0), loss="huber").x
    np.testing.assert_allclose(x, reference, atol=0.01)
    assert weight[:40].mean() < weight[40:].mean()
    assert covariance.shape == (2, 2)


def test_standard_errors_cover_the_scatter_of_repeated_experiments():
    solutions, errors = [], []
    for seed in range(200):
        random = np.random.default_rng(seed)
        run = np.arange(600) // 60
        A = np.stack((random.standard_normal(600), np.ones(600)), axis=1)
        # Each recording has an error of its own, common to its samples.
        y = (
            A @ (2.0, -1.0)
            + 0.1 * random.standard_normal(600)
            + 0.1 * random.standard_normal(10)[run]
        )
        x, covariance, _ = robust_fit(A, y, run)
        solutions.append(x[1])
        errors.append(covariance[1, 1] ** 0.5)
    assert np.mean(errors) == pytest.approx(np.std(solutions), rel=0.2)


def test_the_calibration_names_its_sources_and_what_it_could_not_find():
    calibration = stands.calibration()
    assert calibration.sources == tuple(f"run{n}" for n in range(6))
    assert calibration.nominal_s == pytest.approx(144.0)
    assert "winding_inductance_h" in calibration.not_identified
    assert not calibration.bad_stretches
