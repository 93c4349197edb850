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

"""The PWM period against the balance of volts and amperes, and as the DAQ samples it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.stand_runs import records, scans

from flea_sim_driver.plant.drive import waveform

PHASE = (np.arange(4000) + 0.5) / 4000


@given(
    st.floats(0.05, 5.0), st.floats(-1.0, 14.0), st.sampled_from([-1.0, 1.0]), st.floats(0.6, 3.0)
)
def test_a_period_carries_its_mean_current_and_voltage(
    current: float, emf: float, way: float, reactance: float
) -> None:
    """Mean voltage is R i + back-EMF: the inductance's own share returns each period."""
    if 2.95 * current + emf > 23.0:
        return  # more than the supply can drive
    ones = np.ones_like(PHASE)
    wave = waveform(way * current * ones, way * emf * ones, 2.95, reactance, 24.3, 0.8)
    # Exact while motoring; in light braking a current that breaks off is met within 0.1 A.
    near = 0.01 if emf >= 0.0 else 0.1
    assert way * wave.current(PHASE).mean() == pytest.approx(current, rel=0.02, abs=near)
    if emf > -0.5:
        balance = 2.95 * current + emf
        assert way * wave.voltage(PHASE).mean() == pytest.approx(balance, rel=0.02, abs=0.1)
    square = np.mean(wave.current(PHASE) ** 2)
    assert wave.mean_square_current()[0] == pytest.approx(square, rel=0.01, abs=1e-3)
    assert square >= current**2 * 0.99  # ripple heats


def test_raw_pwm_gathers_in_the_clusters_of_the_recordings() -> None:
    run = scans(
        records(sensors={"vibration": False, "voltage": "instant_pwm"}, duration_s=20.0,
                unit_spread=0.0)
    )["motor_voltage"]  # fmt: skip
    assert np.mean(np.abs(run - 23.0) < 1.0) > 0.03
    assert np.mean(np.abs(run + 25.5) < 1.0) > 0.03
    assert np.mean(np.abs(run + 1.4) < 1.5) > 0.25
    assert run.max() < 24.0
    assert run.min() > -27.0


def test_the_pwm_shows_its_alias_where_the_recordings_have_it() -> None:
    run = scans(records(sensors={"vibration": False, "voltage": "instant_pwm"}, duration_s=30.0))
    spectrum = np.abs(
        np.fft.rfft((run["motor_voltage"] - run["motor_voltage"].mean()) * np.hanning(3000))
    )
    frequency = np.fft.rfftfreq(3000, 0.01)
    band = (frequency > 8.0) & (frequency < 16.0)
    assert frequency[band][np.argmax(spectrum[band])] == pytest.approx(11.7, abs=1.1)


def test_averaged_voltage_is_the_raw_one_without_its_ripple() -> None:
    mean = scans(records(duration_s=20.0))["motor_voltage"]
    raw = scans(records(duration_s=20.0, sensors={"vibration": False, "voltage": "instant_pwm"}))[
        "motor_voltage"
    ]
    smooth = np.convolve(raw, np.ones(50) / 50, "same")[100:-100]
    expected = np.convolve(mean, np.ones(50) / 50, "same")[100:-100]
    assert np.sqrt(np.mean((smooth - expected) ** 2)) < 1.0
    assert np.std(raw) > 1.3 * np.std(mean)
