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

"""The observer on a simulated actuator that shares no code with it, and on real recordings."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.observed import BACKENDS, FLEA_COUNTS, HAVE_NUMBA, NOISE, P, recording
from support.places import FLEA

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.identification import identify
from flea_diag.core.calibration.noise_identification import fitted
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.observers.thermal_filter import ESTIMATE, heat_loops, thermal_filter
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.tools.recordings.flea_data import read_flea_data
from flea_diag.tools.recordings.flea_run import FleaRun

ROWS = compiled_relations("actuator.yaml").residuals

RELATIONS, SLOPE = (compiled_relations("actuator.yaml", None, has) for has in (True, False))
AT = {name: k for k, name in enumerate(ROWS.predicted)}


def observer(backend: str = "numpy", **options: object) -> StateObserver:
    options = {"noise": NOISE, **options}
    return StateObserver(P, RELATIONS, 0.01, np.random.default_rng(1), 200, backend, **options)


def residuals(made: StateObserver, rows: np.ndarray, frozen_from: int = 10**9) -> np.ndarray:
    told = [made.step(row, k >= frozen_from) for k, row in enumerate(rows)]
    return np.array([t.residual for t in told])


def changed(rows: np.ndarray, channel: str, start: int, change: float) -> np.ndarray:
    """A copy with a bias on one channel from some scan on; NaN drops the channel."""
    copy = rows.copy()
    copy[start:, ROWS.index[channel]] += change
    return copy


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["optimal", "kalman"])
def test_residuals_of_a_healthy_actuator_are_as_wide_as_foretold(backend: str, kind: str) -> None:
    made = observer(backend, kind=kind)
    told = [made.step(row) for row in recording()]
    z = np.array([t.residual / np.where(t.sigma > 0, t.sigma, np.nan) for t in told[200:]])
    assert not any(t.diverged for t in told)
    for name, k in AT.items():
        if name == "motor_voltage":  # an input here
            assert np.isnan(z[:, k]).all()
            continue
        assert abs(z[:, k].mean()) < 0.15, name
        assert 0.7 < z[:, k].std() < 1.4, name
    assert 0.7 < np.mean([t.nis / t.measured for t in told[200:]]) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_frozen_observer_keeps_a_sensor_fault_to_its_own_residual(backend: str) -> None:
    """Measured voltage and load drive the model: nothing else can move."""
    rows = recording()
    healthy = residuals(observer(backend), rows, frozen_from=700)
    for channel, size in (
        ("motor_current", 0.5),
        ("actuator_position", 0.003),
        ("motor_temperature", 6.0),
    ):
        faulty = residuals(observer(backend), changed(rows, channel, 700, size), frozen_from=700)
        apart = (faulty - healthy)[700:]
        np.testing.assert_allclose(apart[:, AT[channel]], size, rtol=1e-6)
        others = [k for name, k in AT.items() if name not in (channel, "motor_voltage")]
        np.testing.assert_allclose(apart[:, others], 0.0, atol=1e-12)


@pytest.mark.slow
def test_correcting_observer_smears_what_the_frozen_one_does_not() -> None:
    rows = recording()
    faulty = changed(rows, "actuator_position", 700, 0.003)
    moved = residuals(observer(), faulty)[900:1000, AT["load_position"]]
    kept = residuals(observer(), faulty, frozen_from=700)[900:1000, AT["load_position"]]
    still = residuals(observer(), rows, frozen_from=700)[900:1000, AT["load_position"]]
    assert abs(moved.mean()) > 1e-3
    assert abs(kept.mean() - still.mean()) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "channel",
    [
        "motor_current",
        "motor_voltage",
        "actuator_position",
        "load_force",
        "motor_temperature",
        "ambient_temperature",
    ],
)
def test_goes_on_without_any_one_channel(backend: str, channel: str) -> None:
    rows = recording()
    made = observer(backend)
    told = [made.step(row) for row in changed(rows, channel, 300, math.nan)]
    position = np.array([t.residual[AT["load_position"]] for t in told[300:]])
    assert np.sqrt(np.mean(position**2)) < 3e-4
    assert not told[-1].diverged
    if channel in AT:
        assert np.isnan([t.residual[AT[channel]] for t in told[300:]]).all()
        assert np.isfinite([t.prediction[AT[channel]] for t in told[300:]]).all()


def test_commanded_voltage_stands_in_for_the_measured_one() -> None:
    rows = recording().copy()
    rows[:, ROWS.index["commanded_voltage"]] = (rows[:, ROWS.index["motor_voltage"]] - 0.4) / 1.1
    rows[:, ROWS.index["motor_voltage"]] = np.nan
    p = replace(P, drive_gain=1.1, drive_offset_v=0.4)
    made = StateObserver(p, RELATIONS, 0.01, np.random.default_rng(1), noise=NOISE, backend="numpy")
    np.testing.assert_allclose(
        residuals(made, rows)[1:, AT["motor_current"]],
        residuals(observer(), recording())[1:, AT["motor_current"]],
        atol=1e-9,
    )


@pytest.mark.skipif(not HAVE_NUMBA, reason="numba is not installed")
@pytest.mark.parametrize("sampling", ["mean", "instant_pwm"])
def test_backends_give_the_same_residuals(sampling: str) -> None:
    one, two = (
        residuals(observer(name, voltage_sampling=sampling), recording(), frozen_from=1000)
        for name in ("numpy", "numba")
    )
    np.testing.assert_allclose(two, one, rtol=1e-6, atol=1e-9)


def test_same_seed_and_rows_give_the_same_bits() -> None:
    np.testing.assert_array_equal(
        residuals(observer(), recording()), residuals(observer(), recording())
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_deep_copy_goes_on_by_itself_from_where_it_was_taken(backend: str) -> None:
    rows, made = recording().copy(), observer(backend)
    rows[600:, ROWS.index["motor_speed"]] = np.nan  # other matrices than those that are shared
    made.follow(rows[:500])
    kept = deepcopy(made)
    first = made.follow(rows[500:900]).table
    made.adopt(replace(P, current_offset_a=-0.1))
    made.follow(rows[900:])
    np.testing.assert_array_equal(kept.follow(rows[500:900]).table, first)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_start_before_readings_come_is_the_same_in_one_block_and_scan_by_scan(
    backend: str,
) -> None:
    rows = recording()[:300].copy()
    rows[:5] = np.nan
    block, single = observer(backend), observer(backend)
    whole = block.follow(rows).table
    alone = np.concatenate([single.follow(row[None]).table for row in rows])
    np.testing.assert_array_equal(whole, alone)


@pytest.mark.slow
def test_raw_pwm_is_averaged_by_what_the_current_says() -> None:
    """A sample of +24, 0 or -24 V carries the mean only on average; the current is better."""
    rows, draw = recording().copy(), np.random.default_rng(5)
    mean = rows[:, ROWS.index["motor_voltage"]] - 1.5
    on = draw.random(len(mean)) < np.abs(mean) / 24.0
    rows[:, ROWS.index["motor_voltage"]] = np.where(on, 24.0 * np.sign(mean), 0.0) + 1.5
    pwm = replace(NOISE, voltage_v=9.0, voltage_sample_v=9.0, voltage_walk_v=0.6)
    as_input = residuals(observer(noise=pwm), rows)[200:, AT["motor_current"]]
    wandering = residuals(observer(noise=pwm, voltage_sampling="instant_pwm"), rows)
    assert wandering[200:, AT["motor_current"]].std() < 0.3 * as_input.std()
    voltage = wandering[200:, AT["motor_voltage"]]
    assert abs(voltage.mean()) < 4.0 * voltage.std() / math.sqrt(len(voltage))


def test_offsets_that_are_adopted_take_the_bias_out() -> None:
    rows = changed(recording(), "motor_current", 0, 0.2)
    made = observer()
    residuals(made, rows[:600])
    made.adopt(replace(P, current_offset_a=-0.1))
    assert abs(residuals(made, rows[600:])[50:, AT["motor_current"]].mean()) < 0.02


def test_after_a_gap_it_starts_from_what_is_measured() -> None:
    rows = recording()
    made = observer()
    residuals(made, rows[:300])
    made.interrupt()
    told = [made.step(row) for row in rows[600:]]
    assert abs(told[1].residual[AT["actuator_position"]]) < 4e-4
    assert abs(np.mean([t.residual[AT["motor_temperature"]] for t in told[300:]])) < 0.3
    assert not told[-1].diverged


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["optimal", "kalman"])
@pytest.mark.parametrize("start", [230, 260, 350])
def test_started_in_full_motion_it_is_on_the_track_at_once(
    backend: str, kind: str, start: int
) -> None:
    """Residuals are as wide as foretold from the first: sigma holds what one scan leaves open."""
    rows = recording()[start : start + 60]
    assert abs(rows[0, ROWS.index["motor_speed"]]) > 10.0
    made = observer(backend, kind=kind)
    told = [made.step(row) for row in rows]
    assert not any(t.diverged for t in told)
    assert np.isnan(told[0].residual[: AT["motor_temperature"]]).all()
    assert np.mean([t.nis / t.measured for t in told[1:20]]) < 3.0


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("value", [math.inf, -math.inf, 1e300, -1e12])
def test_one_absurd_scan_does_not_outlast_a_second(backend: str, value: float) -> None:
    rows = recording().copy()
    rows[500] = value
    made = observer(backend)
    told = [made.step(row) for row in rows[:900]]
    position = np.array([t.residual[AT["actuator_position"]] for t in told[600:]])
    assert np.sqrt(np.mean(position**2)) < 3e-4
    assert not told[-1].diverged


def test_numbers_before_the_first_scan_and_wrong_parameters() -> None:
    assert np.isnan(observer().mean).all()
    for options, said in (
        ({"kind": "unscented"}, "filter 'unscented'"),
        ({"voltage_sampling": "median"}, "voltage sampling 'median'"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            observer(**options)
    with pytest.raises(ConfigurationError, match="period_s = 0"):
        StateObserver(P, RELATIONS, 0.0, np.random.default_rng(0))


def heated(cooling_s: float) -> np.ndarray:
    """A node beside air of 24 degC that nothing heats."""
    return thermal_filter(0.01, 0.0, 0.5, [0.0, 1.0 / cooling_s])


def stepped(node: np.ndarray, reading: float) -> tuple[float, float, float]:
    told = np.empty(4)
    heat_loops(node, (reading, 24.0), 0, 0.0, False, told)
    prediction, residual, sigma, _ = told.tolist()
    return prediction, residual, sigma


def test_temperature_of_a_node_that_only_cools() -> None:
    node = heated(cooling_s=100.0)
    stepped(node, 64.0)
    for _ in range(10000):  # one time constant
        prediction, residual, _ = stepped(node, math.nan)
    assert prediction == pytest.approx(24.0 + 40.0 / math.e, abs=0.01)
    assert math.isnan(residual)


def test_temperature_is_the_mean_of_its_readings_where_nothing_happens() -> None:
    node = heated(cooling_s=1e12)
    readings = 30.0 + 0.5 * np.random.default_rng(0).normal(size=101)
    for reading in readings:
        *_, sigma = stepped(node, float(reading))
    # The first reading counts as the prior, 10 K wide.
    assert node[ESTIMATE] == pytest.approx(readings[1:].mean(), abs=0.003)
    assert sigma == pytest.approx(0.5 * math.sqrt(1 + 1 / 99), rel=1e-3)


@pytest.mark.slow
def test_noise_is_fitted_to_what_was_put_in() -> None:
    noise = fitted([NominalRun("nominal", recording(seed=1))], P, RELATIONS, 0.01, "mean")
    readings = dict(noise.readings)
    assert readings["actuator_position_m"] == pytest.approx(6e-5, rel=0.1)
    assert readings["motor_temperature_k"] == pytest.approx(0.57, rel=0.1)
    # Searched in steps of the square root of two.
    assert readings["motor_current_a"] == pytest.approx(0.053, rel=0.5)
    assert noise.voltage_v == pytest.approx(0.2, rel=0.5)
    with pytest.raises(CalibrationError, match="300 scans"):
        fitted([NominalRun("short", recording()[:100])], P, RELATIONS, 0.01, "mean")


@pytest.mark.slow
def test_a_shaft_that_runs_ahead_of_its_nut_counts_as_noise_of_the_speed() -> None:
    """Errors of the lead are smooth: no third difference shows them, and yet they are no motion."""
    ahead = recording(seed=3).copy()
    ahead[:, ROWS.index["motor_speed"]] += 10.0 * np.sin(0.4 * np.arange(len(ahead)))
    noise = fitted([NominalRun("lead", ahead)], P, RELATIONS, 0.01, "mean")
    readings = dict(noise.readings)
    assert 4.0 < readings["motor_speed_rad_s"] < 12.0  # 10 / sqrt(2) and the 2 of the reading


@pytest.mark.slow
def test_gross_errors_do_not_shrink_the_fitted_noise() -> None:
    rough = recording(seed=2).copy()
    rough[::2, ROWS.index["load_force"]] += 4000.0  # as a load that jumps faster than the scans
    noise = fitted([NominalRun("rough", rough)], P, RELATIONS, 0.01, "mean")
    readings = dict(noise.readings)
    assert noise.voltage_v > 0.02
    assert readings["motor_current_a"] > 0.005


# --- real recordings ----------------------------------------------------------------------


def real_rows(file: Path) -> np.ndarray:
    scans = list(FleaRun.of(read_flea_data(file)).scans())
    rows = np.full((len(scans), len(ROWS.channels)), np.nan)
    for k, scan in enumerate(scans):
        for name, value in zip(scan.channels, scan.values, strict=True):
            if name in ROWS.index:
                rows[k, ROWS.index[name]] = value
    return rows


def drag_shown(p: ActuatorParameters, noise: ObserverNoise, rows: np.ndarray) -> float:
    """Mean of the current's residual over sigma, times the sign of the motion, while moving."""
    made = StateObserver(
        p, SLOPE, 0.01, np.random.default_rng(0), noise=noise, voltage_sampling="instant_pwm"
    )
    shown = []
    for k, row in enumerate(rows):
        told, speed = made.step(row), made.mean[2]
        if k >= 300 and abs(speed) > 0.01:
            at = AT["motor_current"]
            shown.append(told.residual[at] / told.sigma[at] * math.copysign(1.0, speed))
    return float(np.mean(shown))


@pytest.mark.slow
def test_real_jam_shows_in_the_currents_residual_and_real_spall_does_not() -> None:
    files = sorted(FLEA.glob("*_Low.data"))
    if not files:
        pytest.skip(f"needs the FLEA recordings: none in {FLEA}, set FLEA_DATA_DIR")
    nominal = [file for file in files if "_Nominal_" in file.name]
    learned = [NominalRun(file.name, real_rows(file)) for file in nominal[::4]]
    relations_of = partial(compiled_relations, "actuator.yaml", ROWS.channels)
    p = identify(learned, relations_of, FLEA_COUNTS.kernel, 0.01).parameters
    fresh = nominal[1::6]
    jam = [file for file in files if "_Jam_" in file.name][::3]
    spall = [file for file in files if "_Spall_" in file.name][::3]
    noise = ObserverNoise(readings=(("motor_current_a", 0.26),))
    drag = {file: drag_shown(p, noise, real_rows(file)) for file in (*fresh, *jam, *spall)}
    healthy = max(abs(drag[file]) for file in (*fresh, *spall))
    assert min(drag[file] for file in jam) > 1.3 * healthy, drag
