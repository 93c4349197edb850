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

"""Vibration stands where kinematics and structure put it, checked by formulas of their own."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from support.stand_runs import Array, fault, records, scans, vibration

from flea_sim_driver.machine.library import find_machine
from flea_sim_driver.plant.structure import StructureSpread

RATE_HZ = 20000.0
NOMINAL = find_machine("flea").structure
LEAD_M, PITCH_M, BALL_M = 3.175e-3, 9.9e-3, 1.588e-3
TRIANGLE = {"kind": "triangle", "amplitude_m": 0.035, "frequency_hz": 0.25, "centre_m": 0.05}


def nut_order() -> float:
    """Balls past a point of the fixed nut for each turn of the screw, from rolling contact.

    The ball train turns with the mean of the surface speeds of screw and (standing) nut.
    """
    radius_screw = 0.5 * (PITCH_M - BALL_M * math.cos(math.pi / 4))
    train_turns = radius_screw / (2.0 * radius_screw + BALL_M * math.cos(math.pi / 4))
    turn_length = math.hypot(math.pi * PITCH_M, LEAD_M)
    return train_turns * turn_length / (1.02 * BALL_M)


@lru_cache(maxsize=32)
def run(name: str, load_n: float = 0.0) -> tuple[dict[str, Array], Array]:
    values: dict[str, Any] = {"motion": TRIANGLE, "sensors": {}, "duration_s": 8.0,
                              "unit_spread": 0.0, "load": {"constant_n": load_n}}  # fmt: skip
    made = records(**values, **(fault(name, 0.0) if name else {}))
    return scans(made), vibration(made)


def envelope(signal: Array) -> Array:
    """Magnitude of the analytic signal between 1 and 9 kHz."""
    spectrum = np.fft.fft(signal)
    frequency = np.fft.fftfreq(len(signal), 1.0 / RATE_HZ)
    keep = (frequency > 1000.0) & (frequency < 9000.0)
    return np.abs(np.fft.ifft(2.0 * spectrum * keep))


def order_spectrum(acceleration: Array, position: Array) -> tuple[Array, Array]:
    """Envelope spectrum over travelled screw angle: (orders, amplitudes)."""
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(position)))]) / LEAD_M
    fine = np.interp(np.arange(len(acceleration)) / RATE_HZ, np.arange(len(travel)) / 100.0, travel)
    squared = envelope(acceleration)
    revolutions = np.arange(fine[0], fine[-1], 1.0 / 128.0)
    even = np.interp(revolutions, fine, squared)
    even = (even - even.mean()) * np.hanning(len(even))
    return np.fft.rfftfreq(len(even), 1.0 / 128.0), np.abs(np.fft.rfft(even))


def test_the_papers_geometry_gives_the_known_order() -> None:
    assert nut_order() == pytest.approx(8.56, abs=0.01)


@pytest.mark.parametrize("motion", ["triangle", "sweep"])
def test_a_spalled_nut_is_struck_at_the_ball_pass_order_whatever_the_speed(motion: str) -> None:
    shape: dict[str, Any] = {
        "triangle": TRIANGLE,
        "sweep": {"kind": "sweep", "amplitude_m": 0.03, "frequency_hz": 0.1,
                  "end_frequency_hz": 0.6, "centre_m": 0.05},
    }[motion]  # fmt: skip
    made = records(motion=shape, sensors={}, duration_s=12.0, unit_spread=0.0,
                   **fault("spall", 0.0))  # fmt: skip
    orders, amplitude = order_spectrum(vibration(made)[:, 3], scans(made)["actuator_position"])
    band = (orders > 5.0) & (orders < 12.0)
    peak = orders[band][np.argmax(amplitude[band])]
    assert peak == pytest.approx(nut_order(), rel=0.015)  # the slip is 1.5 %
    near = np.abs(orders - nut_order()) < 0.25
    assert amplitude[near].max() > 4.0 * np.median(amplitude[band])


def test_a_healthy_nut_shows_no_such_line() -> None:
    slow, fast = run("")
    orders, amplitude = order_spectrum(fast[:, 3], slow["actuator_position"])
    band = (orders > 5.0) & (orders < 12.0)
    near = np.abs(orders - nut_order()) < 0.25
    assert amplitude[near].max() < 4.0 * np.median(amplitude[band])


def kurtosis(signal: Array) -> float:
    return float(np.mean((signal - signal.mean()) ** 4) / np.var(signal) ** 2)


def levels(name: str) -> Array:
    """Standard deviation of each accelerometer's first axis over the nominal one."""
    faulted, healthy = run(name)[1], run("")[1]
    return np.std(faulted[40000:, [0, 3]], axis=0) / np.std(healthy[40000:, [0, 3]], axis=0)


def test_faults_raise_the_accelerometers_that_they_should() -> None:
    for name in ("spall", "jam", "ball_nut_friction"):  # on the nut, hardly on the motor
        motor, nut = levels(name)
        assert nut > 1.4, name
        assert motor < 0.6 * nut, name
    for name in ("rotor_eccentricity", "backlash"):  # on both
        assert np.all(levels(name) > 1.2), name
    np.testing.assert_allclose(levels("winding_short"), 1.0, atol=0.25)  # on neither


def test_a_jam_rubs_in_bursts_and_lost_lubrication_hisses() -> None:
    assert kurtosis(run("jam")[1][40000:, 3]) > 8.0
    assert kurtosis(run("ball_nut_friction")[1][40000:, 3]) < 5.0


def test_backlash_knocks_when_the_load_changes_side() -> None:
    slow, fast = run("backlash")
    side = np.sign(slow["load_force"])
    turns = (np.flatnonzero(np.diff(side) != 0) + 1) / 100.0
    loud = np.flatnonzero(np.abs(fast[:, 3]) > 15.0) / RATE_HZ
    assert len(loud) > 0
    nearest = np.abs(loud[:, None] - turns[None, :]).min(axis=1)
    assert np.max(nearest) < 0.06


def test_eccentricity_stands_at_once_a_revolution() -> None:
    slow, fast = run("rotor_eccentricity")
    # Angle with its sign: a force that turns with the rotor turns back with it.
    angle = slow["actuator_position"] / LEAD_M
    fine = np.interp(np.arange(len(fast)) / RATE_HZ, np.arange(len(angle)) / 100.0 + 0.005, angle)
    stroke = slice(int(2.2 * RATE_HZ), int(2.8 * RATE_HZ))  # one way, between two reversals
    turns, values = fine[stroke], fast[stroke, 0]
    if turns[0] > turns[-1]:
        turns, values = turns[::-1], values[::-1]
    even = np.linspace(turns[0], turns[-1], 4096)
    spectrum = np.abs(np.fft.rfft(np.interp(even, turns, values) * np.hanning(4096), 32768))
    orders = np.fft.rfftfreq(32768, even[1] - even[0])
    band = (orders > 0.3) & (orders < 5.0)
    assert orders[band][np.argmax(spectrum[band])] == pytest.approx(1.0, abs=0.1)


def test_the_structure_rings_at_its_own_frequencies() -> None:
    _, fast = run("spall")
    frequency = np.fft.rfftfreq(len(fast), 1.0 / RATE_HZ)

    def energy(axis: int, at_hz: float) -> float:
        band = np.abs(frequency - at_hz) < 100.0
        return float(np.sum(np.abs(np.fft.rfft(fast[:, axis]))[band] ** 2))

    for axis, modes in ((3, (1800.0, 4200.0, 7500.0)), (0, (900.0, 3100.0))):
        for mode in modes:
            beside = max(energy(axis, 0.85 * mode), energy(axis, 1.18 * mode))
            assert energy(axis, mode) > 1.8 * beside, (axis, mode)


def test_background_grows_with_speed() -> None:
    slow, fast = run("")
    block = np.std(fast[:, 3].reshape(-1, 2000), axis=1)
    speed = np.abs(slow["motor_speed"]).reshape(-1, 10).mean(axis=1)
    assert np.corrcoef(block[5:], speed[5:])[0, 1] > 0.7


def strongest_hz(seed: int, axis: int, low_hz: float, high_hz: float, **values: Any) -> float:
    """Frequency of the strongest resonance of a unit in a band."""
    fast = vibration(records(motion=TRIANGLE, sensors={}, duration_s=4.0, seed=seed, **values))
    frequency = np.fft.rfftfreq(4096, 1.0 / RATE_HZ)
    frames = fast[20000 : 20000 + 14 * 4096, axis].reshape(14, 4096) * np.hanning(4096)
    power = (np.abs(np.fft.rfft(frames)) ** 2).mean(axis=0)
    smooth = np.convolve(power, np.ones(9) / 9, "same")
    band = (frequency > low_hz) & (frequency < high_hz)
    return float(frequency[band][np.argmax(smooth[band])])


def test_each_unit_has_resonances_of_its_own() -> None:
    drawn = [strongest_hz(seed, 3, 3300.0, 5100.0) for seed in range(1, 7)]
    assert len(set(drawn)) > 4
    assert all(0.79 * 4200.0 < value < 1.21 * 4200.0 for value in drawn)
    assert np.ptp(drawn) > 0.1 * 4200.0
    alike = {
        strongest_hz(seed, 3, 3300.0, 5100.0, structure={"resonance": 0.0}) for seed in (1, 2, 3)
    }
    assert max(alike) - min(alike) < 0.04 * 4200.0


def test_a_structure_draws_within_its_spread() -> None:
    spread = StructureSpread(resonance=0.2, damping=0.15, background=0.3)
    units = [spread.draw(NOMINAL, np.random.default_rng(seed)) for seed in range(300)]
    shift = np.array([unit.modes[1][1].frequency_hz / 4200.0 - 1.0 for unit in units])
    assert np.abs(shift).max() <= 0.2
    assert np.std(shift) == pytest.approx(0.2 / math.sqrt(3.0), rel=0.08)  # uniform
    assert np.std([math.log(u.background[0]) for u in units]) == pytest.approx(0.3, rel=0.15)
    assert StructureSpread(0.0, 0.0, 0.0).draw(NOMINAL, np.random.default_rng(1)) == NOMINAL


@pytest.mark.parametrize("rate_hz", [2000.0, 20000.0, 64000.0])
def test_a_knock_is_as_strong_at_any_rate_that_can_show_it(rate_hz: float) -> None:
    made = records(motion=TRIANGLE, sensors={"vibration_rate_hz": rate_hz}, duration_s=4.0,
                   unit_spread=0.0, **fault("backlash", 0.0))  # fmt: skip
    fast = vibration(made)
    assert np.isfinite(fast).all()
    assert len(fast) == 4.0 * rate_hz
    peak = np.abs(fast[:, 0]).max()  # the motor's lowest mode, 900 Hz, passes all three
    assert 10.0 < peak < 150.0
