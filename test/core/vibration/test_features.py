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

"""Features against closed forms and other libraries."""

from __future__ import annotations

import math

import numpy as np
import pytest
import pywt
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal, stats
from support.places import ROOT

from flea_diag.core.vibration.bearing_frequencies import BallScrew, Bearing, Gear, Kinematics
from flea_diag.core.vibration.features import (
    FEATURES,
    FeatureId,
    Scope,
    all_ids,
    compute,
    compute_all,
)
from flea_diag.core.vibration.features_envelope import named_line
from flea_diag.core.vibration.features_spectral import wavelet_packet_energies, welch
from flea_diag.core.vibration.window import NotComputableError, Window
from flea_diag.errors import ConfigurationError

RATE = 20_000.0
TIME = np.arange(20_000) / RATE
NOISE = np.random.default_rng(1).standard_normal((20_000, 3))
SINE = np.sin(2.0 * np.pi * 500.0 * TIME)


def window(*columns: np.ndarray, **motion: object) -> Window:
    axes = tuple(f"accelerometer_1_{axis}" for axis in "xyz")[: len(columns)]
    return Window(np.column_stack(columns), RATE, axes, **motion)  # type: ignore[arg-type]


def of(name: str, *columns: np.ndarray, **motion: object) -> float:
    return compute(f"accelerometer_1_{name}", window(*columns, **motion))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("std", 3.0 / math.sqrt(2.0)),
        ("rms", math.sqrt(9.8**2 + 4.5)),
        ("mean", 9.8),
        ("peak", 3.0),
        ("crest", math.sqrt(2.0)),
        ("skewness", 0.0),
        ("kurtosis", 1.5),
        ("impulse_factor", math.pi / 2.0),
        ("shape_factor", math.pi / math.sqrt(8.0)),
        ("local_kurtosis", 1.5),
        ("intermittence", 1.0),
        ("band_100_500_rms", 0.0),
        ("band_500_1500_rms", 3.0 / math.sqrt(2.0)),
        ("spectral_centroid", 500.0),
    ],
)
def test_sine_has_its_closed_form(name: str, expected: float) -> None:
    assert of(name, 9.8 + 3.0 * SINE) == pytest.approx(expected, rel=5e-3, abs=2e-3)


def test_moments_of_noise_agree_with_scipy() -> None:
    skewed = np.exp(0.5 * NOISE[:, 0])
    assert of("kurtosis", skewed) == pytest.approx(stats.kurtosis(skewed, fisher=False), rel=1e-4)
    assert of("skewness", skewed) == pytest.approx(stats.skew(skewed), rel=1e-4)


def test_levels_of_axes_combine_as_root_mean_square() -> None:
    assert of("std", 3.0 * SINE, 4.0 * SINE) == pytest.approx(math.sqrt((9 + 16) / 2 / 2), rel=1e-4)


def test_bands_of_white_noise_add_up_to_its_variance() -> None:
    bands = [name for name in FEATURES if name.startswith("band_")]
    total = sum(of(name, NOISE[:, 0]) ** 2 for name in bands)
    # The bands cover 5 to 9500 of 10000 Hz.
    assert total == pytest.approx(0.9495, abs=0.02)


def test_welch_agrees_with_scipy() -> None:
    frequency, density = welch(window(*NOISE.T))
    wanted = signal.welch(NOISE.T, RATE, "hann", nperseg=1024)
    np.testing.assert_allclose(frequency, wanted[0])
    np.testing.assert_allclose(density, wanted[1], rtol=2e-3)


def test_wavelet_packets_agree_with_pywavelets() -> None:
    row = NOISE[:, 0] + 4.0 * SINE
    tree = pywt.WaveletPacket(row - row.mean(), "db4", "periodization", maxlevel=3)
    wanted = [float(np.sum(node.data**2)) for node in tree.get_level(3, order="freq")]
    np.testing.assert_allclose(wavelet_packet_energies(window(row))[0], wanted, rtol=1e-4)


def test_coherence_of_a_shared_source_agrees_with_scipy() -> None:
    first, second = NOISE[:, 0] + NOISE[:, 2], NOISE[:, 1] + NOISE[:, 2]
    wanted = np.mean(signal.coherence(first, second, RATE, "hann", nperseg=1024)[1])
    both = Window(
        np.column_stack([first, second]), RATE, ("accelerometer_1_x", "accelerometer_2_x")
    )
    assert compute("accelerometers_coherence", both) == pytest.approx(wanted, rel=1e-3)
    assert of("axis_coherence", first, second) == pytest.approx(wanted, rel=1e-3)


def test_white_noise_is_flat_and_a_line_is_not() -> None:
    assert of("spectral_flatness", NOISE[:, 0]) > 0.95
    assert of("spectral_flatness", SINE + 1e-3 * NOISE[:, 0]) < 0.01


def test_spectral_kurtosis_finds_the_band_of_impacts() -> None:
    ring = np.exp(-400.0 * TIME[:400]) * np.sin(2.0 * np.pi * 6000.0 * TIME[:400])
    impacts = np.zeros(20_000)
    for start in range(500, 19_000, 1700):
        impacts[start : start + 400] += 20.0 * ring
    shaken = impacts + NOISE[:, 0]
    assert of("spectral_kurtosis_peak", NOISE[:, 0]) < 1.0
    assert of("spectral_kurtosis_peak", shaken) > 5.0
    assert of("kurtogram_peak", shaken) > 5.0
    assert of("kurtogram_band", shaken) == pytest.approx(6000.0, abs=1000.0)


# --- kinematics and order tracking -----------------------------------------------------------

SCREW = BallScrew(9.9e-3, 1.588e-3, 3.175e-3)


def test_orders_of_the_flea_screw() -> None:
    """Values worked by hand: helix 5.83 deg, 19.3 balls a turn."""
    orders = SCREW.orders()
    assert orders["nut"] == pytest.approx(8.56, abs=0.01)
    assert orders["screw"] == pytest.approx(10.75, abs=0.01)
    assert orders["ball"] == pytest.approx(6.15, abs=0.01)


def test_orders_of_a_published_bearing() -> None:
    """SKF 6205: 3.5848, 5.4152 and 2 x 2.357 are the values published for the test stand."""
    orders = Bearing(39.04e-3, 7.94e-3, 9).orders()
    assert orders["outer"] == pytest.approx(3.5848, abs=2e-3)
    assert orders["inner"] == pytest.approx(5.4152, abs=2e-3)
    assert orders["ball"] == pytest.approx(4.7135, abs=3e-3)


def test_orders_of_a_drive_count_turns_of_the_motor() -> None:
    """A screw behind a gear of 4 to 1, a bearing at half the speed, a wheel of 60 teeth."""
    screw = BallScrew(9.9e-3, 1.588e-3, 3.175e-3, turns=0.25)
    drive = Kinematics(screw, Bearing(39.04e-3, 7.94e-3, 9, turns=0.5), Gear(60, turns=0.25))
    expected = {
        "nut": 8.56 / 4, "screw": 10.75 / 4, "ball": 6.15 / 4, "bearing_outer": 3.5848 / 2,
        "bearing_inner": 5.4152 / 2, "bearing_ball": 4.7135 / 2, "gear_mesh": 15.0,
    }  # fmt: skip
    assert drive.orders() == pytest.approx(expected, abs=4e-3)
    assert Kinematics().orders() == {}


def test_the_mesh_of_a_gear_is_a_line_unless_it_is_too_fast_for_the_rate() -> None:
    speed = np.linspace(60.0, 120.0, 20_000)
    mesh = np.sin(48.0 * np.cumsum(speed) / RATE) + NOISE[:, 0]
    moved = {"speed_rad_s": speed, "orders": {"gear_mesh": 48.0}}
    assert of("gear_mesh_line", mesh, **moved) > 10.0
    assert of("gear_mesh_line", NOISE[:, 0], **moved) < 5.0
    orders = {"gear_mesh": 48.0}
    slow = Window(mesh[::12, None], RATE / 12, ("accelerometer_1_x",), speed[::12], orders=orders)
    with pytest.raises(NotComputableError, match=r"mesh at 916\.\d Hz, above half the rate"):
        compute("accelerometer_1_gear_mesh_line", slow)


def test_at_half_the_rate_bands_beyond_nyquist_are_left_out_and_lines_are_not() -> None:
    speed = np.full(20_000, 90.0)
    orders = Kinematics(bearing=Bearing(39.04e-3, 7.94e-3, 9)).orders()
    shaken = struck(orders["bearing_outer"], speed)[::2, None]
    half = Window(shaken, RATE / 2, ("accelerometer_1_x",), speed[::2], orders=orders)
    bands = [f"accelerometer_1_{name}" for name in FEATURES if name.startswith("band_")]
    found = compute_all(bands, half)
    left_out = {name for name, value in found.items() if math.isnan(value)}
    assert left_out == {"accelerometer_1_band_3000_6000_rms", "accelerometer_1_band_6000_9500_rms"}
    lines = {name: compute(f"accelerometer_1_{name}_line", half) for name in orders}
    assert max(lines, key=lines.__getitem__) == "bearing_outer"
    assert lines["bearing_outer"] > 6.0


def struck(order: float, speed: np.ndarray, strength: float = 3.0) -> np.ndarray:
    """A ring at each strike of a defect, whatever the speed does; on a floor of noise."""
    strikes = np.floor(np.cumsum(np.abs(speed)) / RATE / (2.0 * np.pi) * order)
    at = np.flatnonzero(np.diff(strikes))
    ring = np.exp(-800.0 * TIME[:200]) * np.sin(2.0 * np.pi * 4200.0 * TIME[:200])
    train = np.zeros(len(speed))
    train[at] = strength
    return np.convolve(train, ring)[: len(speed)] + 0.2 * NOISE[: len(speed), 0]


@pytest.mark.parametrize("line", ["nut", "screw", "ball"])
@pytest.mark.parametrize(
    "speed",
    [
        np.full(20_000, 90.0),
        np.linspace(30.0, 150.0, 20_000),
        120.0 * np.cos(2.0 * np.pi * 0.8 * TIME),
    ],
    ids=["constant", "sweep", "to and fro"],
)
def test_defect_stands_out_at_its_own_order(line: str, speed: np.ndarray) -> None:
    orders = SCREW.orders()
    shaken = struck(orders[line], speed)
    found = {name: of(f"{name}_line", shaken, speed_rad_s=speed, orders=orders) for name in orders}
    assert found[line] > 6.0
    assert max(found, key=found.__getitem__) == line
    assert named_line(window(shaken, speed_rad_s=speed, orders=orders)) == line


@pytest.mark.parametrize("line", ["nut", "screw", "ball"])
def test_impacts_go_with_their_strength_from_the_first_on(line: str) -> None:
    """From below the noise to ten times above it, where the ratio of the line stops growing."""
    speed, orders = np.full(20_000, 90.0), SCREW.orders()

    def found(strength: float, name: str = line) -> float:
        shaken = struck(orders[line], speed, strength)
        return of(f"{name}_impacts", shaken, speed_rad_s=speed, orders=orders)

    one = found(1.0)
    assert one > 0.2
    for strength in (0.4, 2.0, 4.0, 10.0):
        assert found(strength) == pytest.approx(strength * one, rel=0.12)
    assert abs(found(0.0)) < 0.1 * found(2.0)
    for other in set(orders) - {line}:
        assert found(2.0, other) < 0.5 * found(2.0)


def test_noise_alone_is_given_no_name() -> None:
    speed = np.full(20_000, 90.0)
    quiet = window(NOISE[:, 0], speed_rad_s=speed, orders=SCREW.orders())
    assert named_line(quiet) == "unclassified"


def test_unbalance_is_read_at_the_first_order_through_a_sweep() -> None:
    speed = np.linspace(60.0, 120.0, 20_000)
    once = 0.7 * np.sin(np.cumsum(speed) / RATE)
    assert of("order_1_amplitude", once, speed_rad_s=speed) == pytest.approx(0.7, rel=0.05)


# --- motion --------------------------------------------------------------------------------

SWING = 80.0 * np.cos(2.0 * np.pi * 0.9 * TIME + 0.3)


def test_machine_noise_rests_with_the_machine_and_sensor_noise_does_not() -> None:
    machine = NOISE[:, 0] * np.abs(SWING) / 80.0
    assert of("rest_moving_ratio", machine, speed_rad_s=SWING) < 0.15
    assert of("rest_moving_ratio", NOISE[:, 1], speed_rad_s=SWING) == pytest.approx(1.0, abs=0.1)
    assert of("speed_correlation", machine, speed_rad_s=SWING) > 0.9
    assert abs(of("speed_correlation", NOISE[:, 1], speed_rad_s=SWING)) < 0.3
    assert of("rest_std", NOISE[:, 1], speed_rad_s=SWING) == pytest.approx(1.0, abs=0.1)


def test_knock_at_a_reversal_stands_above_the_rest() -> None:
    turn = int(np.flatnonzero(np.diff(np.sign(SWING)))[0])
    knocked = NOISE[:, 0].copy()
    knocked[turn + 100] = 30.0
    elsewhere = NOISE[:, 0].copy()
    elsewhere[turn + 4000] = 30.0
    assert of("reversal_ratio", knocked, speed_rad_s=SWING) == pytest.approx(30.0, rel=0.05)
    assert of("reversal_ratio", elsewhere, speed_rad_s=SWING) < 5.0


def scans(**slow: np.ndarray) -> Window:
    return Window(np.empty((0, 0)), 1.0, (), None, slow, np.arange(100) / 100.0)


def test_current_regression_returns_the_coefficients_that_made_the_current() -> None:
    time = np.arange(100) / 100.0
    speed = 60.0 * np.sin(2.0 * np.pi * 1.3 * time) + 20.0 * np.sin(2.0 * np.pi * 3.1 * time)
    acceleration = np.gradient(speed, time)
    current = 0.32 + 0.4 * np.sign(speed) + 5e-3 * speed + 1e-4 * acceleration
    window = scans(motor_speed=speed, motor_current=current)
    assert compute("motor_current_coulomb", window) == pytest.approx(0.4, rel=1e-6)
    assert compute("motor_current_viscous", window) == pytest.approx(5e-3, rel=1e-6)


def test_voltage_regression_returns_resistance_and_back_emf_constant() -> None:
    time = np.arange(100) / 100.0
    speed, current = 60.0 * np.sin(8.0 * time), 1.0 + np.cos(5.0 * time)
    window = scans(
        motor_speed=speed, motor_current=current, motor_voltage=0.2 + 3.1 * current + 0.06 * speed
    )
    assert compute("motor_voltage_current", window) == pytest.approx(3.1, rel=1e-6)
    assert compute("motor_voltage_speed", window) == pytest.approx(0.06, rel=1e-6)
    still = scans(motor_speed=np.zeros(100), motor_current=current, motor_voltage=current)
    with pytest.raises(NotComputableError, match="slower than 10 rad/s"):
        compute("motor_voltage_speed", still)
    steady = scans(motor_speed=np.full(100, 40.0), motor_current=current, motor_voltage=current)
    with pytest.raises(NotComputableError, match="does not separate current and speed"):
        compute("motor_voltage_current", steady)


def test_heating_is_the_slope() -> None:
    window = scans(motor_temperature=24.0 + 0.06 * np.arange(100) / 100.0)
    assert compute("motor_heating", window) == pytest.approx(0.06, rel=1e-9)


# --- refusals and ids ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "samples", "reason"),
    [
        ("kurtosis", np.zeros(20_000), "constant"),
        ("std", np.full(20_000, np.nan), "not finite"),
        ("order_1_amplitude", NOISE[:, 0], "motor_speed is not measured"),
        ("nut_line", NOISE[:, 0], "kinematics of the stand do not give this line"),
        ("axis_coherence", NOISE[:, 0], "needs two axes, the window has one"),
        ("spectral_centroid", NOISE[:1000, 0], "too few"),
    ],
)
def test_refusal_says_why(name: str, samples: np.ndarray, reason: str) -> None:
    with pytest.raises(NotComputableError, match=reason):
        of(name, samples)


def test_order_tracking_needs_motion() -> None:
    resting = np.full(20_000, 1.0)
    with pytest.raises(NotComputableError, match="revolutions"):
        of("nut_line", NOISE[:, 0], speed_rad_s=resting, orders=SCREW.orders())
    with pytest.raises(NotComputableError, match=r"less than 0\.01 s above 30"):
        of("rest_moving_ratio", NOISE[:, 0], speed_rad_s=resting)


def test_every_id_reads_back_and_has_unit_and_words() -> None:
    axes = ("accelerometer_1_x", "accelerometer_2_x")
    ids = all_ids(axes)
    assert len(set(ids)) == len(ids)
    for text in ids:
        found = FeatureId.parse(text)
        assert str(found) == text
        assert found.feature.unit
        assert len(found.feature.words) > 10
    both = [row for row in FEATURES.values() if row.scope is Scope.ACCELEROMETER]
    assert len(ids) == len(FEATURES) + len(both)


@pytest.mark.parametrize(
    "text",
    [
        "std",
        "accelerometer_1",
        "accelerometer_x_std",
        "motor_1_std",
        "accelerometer_1_coherence",
        "accelerometers_std",
        "",
    ],
)
def test_unknown_id_is_refused_by_name(text: str) -> None:
    with pytest.raises(ConfigurationError, match="feature"):
        FeatureId.parse(text)


@given(st.floats(0.01, 100.0), st.integers(0, 2**31))
def test_shape_features_do_not_depend_on_the_scale(scale: float, seed: int) -> None:
    noise = np.random.default_rng(seed).standard_normal(4000)
    ids = [f"accelerometer_1_{n}" for n in ("crest", "kurtosis", "shape_factor", "skewness")]
    one, other = compute_all(ids, window(noise)), compute_all(ids, window(scale * noise))
    for text in ids:
        assert other[text] == pytest.approx(one[text], rel=1e-3, abs=1e-4)
        assert compute(text, window(noise)) == one[text]


def test_every_feature_stands_in_the_table_of_the_document() -> None:
    text = (ROOT / "docs" / "features.md").read_text("utf-8")
    documented = {line.split("`")[1] for line in text.splitlines() if line.startswith("| `")}
    assert documented == set(FEATURES)
    for row in FEATURES.values():
        assert row.words.replace("|", r"\|") in text


def test_a_window_that_gets_its_motion_keeps_what_was_computed_of_it() -> None:
    bare = window(NOISE[:, 0])
    before = compute("accelerometer_1_shape_factor", bare)
    moved = bare.moved(SWING, {}, np.empty(0))
    assert moved.centred is bare.centred
    assert moved.results == bare.results
    assert bare.speed_rad_s is None
    assert compute("accelerometer_1_shape_factor", moved) == before
    at_once = compute("accelerometer_1_rest_std", window(NOISE[:, 0], speed_rad_s=SWING))
    assert compute("accelerometer_1_rest_std", moved) == at_once
