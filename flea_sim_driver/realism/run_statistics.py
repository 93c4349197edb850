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

"""Statistics that characterise a run of the stand, real or simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_sim_driver.acquisition.recording import RATE_HZ, RunSignals

Array = npt.NDArray[np.float64]
MOVING_M_S = 4e-3
FORCE_CONSTANT_N_PER_A = 176.7

EDGE = slice(200, -50)


def stroke(run: RunSignals) -> float:
    """Half of the travel between its 1st and 99th percentile, m."""
    low, high = np.percentile(run.smooth["position"][EDGE], [1.0, 99.0])
    return float(0.5 * (high - low))


def peak_speed(run: RunSignals) -> float:
    """99th percentile of speed, m/s."""
    return float(np.percentile(np.abs(run.smooth["speed"][EDGE]), 99.0))


def _centred(values: Array) -> Array:
    return np.asarray(values - np.median(values))


def current_rms(run: RunSignals) -> float:
    """Effective current about its offset, A."""
    sign = 1.0 if run.simulated else -1.0
    return float(np.sqrt(np.mean((run.current - sign * 0.32) ** 2)))


def current_ripple(run: RunSignals) -> float:
    """Standard deviation of the current about its 5 Hz mean, A."""
    return float(np.std((run.current - run.smooth["current"])[EDGE]))


def voltage_rms(run: RunSignals) -> float:
    """Standard deviation of the 5 Hz mean of the voltage, V."""
    return float(np.std(run.smooth["voltage"][EDGE]))


def share_on_rails(run: RunSignals) -> float:
    """Share of the voltage samples taken while the bridge was on."""
    return float(np.mean(np.abs(run.voltage) > 20.0))


def share_freewheeling(run: RunSignals) -> float:
    """Share of the voltage samples within 1.5 V of the middle cluster."""
    return float(np.mean(np.abs(_centred(run.voltage)) < 1.5))


def load_rms(run: RunSignals) -> float:
    """Standard deviation of the load, N."""
    return float(np.std(run.force[EDGE]))


def load_peak(run: RunSignals) -> float:
    """99.9th percentile of the load's magnitude, N."""
    return float(np.percentile(np.abs(run.force), 99.9))


def load_roughness(run: RunSignals) -> float:
    """Standard deviation of the load about its 5 Hz mean, N."""
    return float(np.std((run.force - run.smooth["force"])[EDGE]))


def load_current_rms(run: RunSignals) -> float:
    """Standard deviation of the load motor's current, A."""
    return float(np.std(run.load_current[EDGE]))


def _balance(run: RunSignals) -> Array:
    """Drive force less load, regressed on 1, sgn v, v, a: N, N, N s/m, kg."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    moving = np.abs(cut["speed"]) > MOVING_M_S
    drive = FORCE_CONSTANT_N_PER_A * cut["current"] - cut["force"]
    columns = np.column_stack(
        [np.ones_like(drive), np.sign(cut["speed"]), cut["speed"], cut["acceleration"]]
    )
    solution, *_ = np.linalg.lstsq(columns[moving], drive[moving], rcond=None)
    return np.asarray(solution)


def friction_force(run: RunSignals) -> float:
    """Loss of the drive over its path, N."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    drive = (
        FORCE_CONSTANT_N_PER_A * (cut["current"] - _balance(run)[0] / FORCE_CONSTANT_N_PER_A)
        - cut["force"]
    )
    travelled = np.sum(np.abs(cut["speed"]))
    return float(np.sum(drive * cut["speed"]) / travelled)


def _winding(run: RunSignals) -> tuple[float, float]:
    """Regression of the voltage on current, speed, 1: ohm, V s/m; NaN on a bad channel."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    columns = np.column_stack([cut["current"], cut["speed"], np.ones_like(cut["speed"])])
    solution, *_ = np.linalg.lstsq(columns, cut["voltage"], rcond=None)
    usable = float(np.std(cut["voltage"] - columns @ solution)) < 2.0
    return (float(solution[0]), float(solution[1])) if usable else (float("nan"), float("nan"))


def resistance(run: RunSignals) -> float:
    """Winding resistance, ohm; NaN on a bad channel."""
    return _winding(run)[0]


def back_emf(run: RunSignals) -> float:
    """Back-EMF constant of the same regression, V s/m."""
    return _winding(run)[1]


def force_constant(run: RunSignals) -> float:
    """Force for each ampere, from current regressed on load, sgn v, v, a while it moves, N/A."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    speed = cut["speed"]
    moving = np.abs(speed) > MOVING_M_S
    columns = np.column_stack(
        [cut["force"], np.sign(speed), speed, cut["acceleration"], np.ones_like(speed)]
    )
    solution, *_ = np.linalg.lstsq(columns[moving], cut["current"][moving], rcond=None)
    return float(1.0 / solution[0])


def heating_rate(run: RunSignals) -> float:
    """Slope of the motor's temperature, K/s, outliers cut."""
    time = np.arange(len(run.motor_temperature)) / RATE_HZ
    values = run.motor_temperature
    near = np.abs(values - np.median(values)) < 5.0 * max(_robust(values), 1e-6)
    return float(np.polyfit(time[near], values[near], 1)[0])


def position_noise(run: RunSignals) -> float:
    """Standard deviation of the position from scan to scan, its second difference, m."""
    return float(_robust(np.diff(run.position, 2)) / 6.0**0.5)


def motor_temperature_noise(run: RunSignals) -> float:
    """Robust standard deviation of the motor's thermocouple about its 5 Hz mean, K."""
    return _robust(run.motor_temperature - run.smooth["motor_temperature"])


def nut_temperature_noise(run: RunSignals) -> float:
    """The same of the nut's thermocouple, K."""
    return _robust(run.nut_temperature - run.smooth["nut_temperature"])


def _robust(values: Array) -> float:
    return float(1.4826 * np.median(np.abs(_centred(values))))


def pwm_line(run: RunSignals) -> float:
    """Frequency of the strongest line of the voltage between 8 and 16 Hz, Hz."""
    values = (run.voltage - run.smooth["voltage"]) * np.hanning(len(run.voltage))
    spectrum = np.abs(np.fft.rfft(values))
    frequency = np.fft.rfftfreq(len(values), 1.0 / RATE_HZ)
    band = (frequency > 8.0) & (frequency < 16.0)
    return float(frequency[band][np.argmax(spectrum[band])])


def _band(signal: str, low_hz: float, high_hz: float) -> Callable[[RunSignals], float]:
    """Effective value of a raw signal between two frequencies."""

    def effective(run: RunSignals) -> float:
        frequency, density = spectrum(run, signal)
        inside = (frequency >= low_hz) & (frequency < high_hz)
        return float(np.sqrt(density[inside].sum() * frequency[1]))

    return effective


def spectrum(run: RunSignals, signal: str) -> tuple[Array, Array]:
    """Frequencies in Hz and power density of a raw signal, by Welch over 2.56 s."""
    from scipy.signal import welch

    frequency, density = welch(getattr(run, signal), fs=RATE_HZ, nperseg=256)
    return np.asarray(frequency), np.asarray(density)


def coulomb_friction(run: RunSignals) -> float:
    """Dry friction of the regression on 1, sgn v, v, a; N."""
    return float(_balance(run)[1])


def viscous_friction(run: RunSignals) -> float:
    """Viscous friction of the same regression, N s/m."""
    return float(_balance(run)[2])


@dataclass(frozen=True)
class Statistic:
    """One statistic of a run, and the picture it belongs to."""

    group: str
    unit: str
    of: Callable[[RunSignals], float]


SPECTRA = "noise spectra"
CURRENT = "current against load and speed"
FRICTION = "friction by regression"
STROKE = "stroke"
HEATING = "heating"
CLUSTERS = "voltage clusters"

STATISTICS: dict[str, Statistic] = {
    "stroke": Statistic(STROKE, "m", stroke),
    "peak_speed": Statistic(STROKE, "m/s", peak_speed),
    "load_rms": Statistic(CURRENT, "N", load_rms),
    "load_peak": Statistic(CURRENT, "N", load_peak),
    "current_rms": Statistic(CURRENT, "A", current_rms),
    "load_current_rms": Statistic(CURRENT, "A", load_current_rms),
    "force_constant": Statistic(CURRENT, "N/A", force_constant),
    "resistance": Statistic(CURRENT, "ohm", resistance),
    "back_emf": Statistic(CURRENT, "V s/m", back_emf),
    "friction_force": Statistic(FRICTION, "N", friction_force),
    "coulomb_friction": Statistic(FRICTION, "N", coulomb_friction),
    "viscous_friction": Statistic(FRICTION, "N s/m", viscous_friction),
    "current_ripple": Statistic(SPECTRA, "A", current_ripple),
    "current_5_to_20_hz": Statistic(SPECTRA, "A", _band("current", 5.0, 20.0)),
    "current_above_20_hz": Statistic(SPECTRA, "A", _band("current", 20.0, 51.0)),
    "load_roughness": Statistic(SPECTRA, "N", load_roughness),
    "load_5_to_20_hz": Statistic(SPECTRA, "N", _band("force", 5.0, 20.0)),
    "load_above_20_hz": Statistic(SPECTRA, "N", _band("force", 20.0, 51.0)),
    "position_noise": Statistic(SPECTRA, "m", position_noise),
    "motor_temperature_noise": Statistic(SPECTRA, "K", motor_temperature_noise),
    "nut_temperature_noise": Statistic(SPECTRA, "K", nut_temperature_noise),
    "pwm_line": Statistic(SPECTRA, "Hz", pwm_line),
    "voltage_rms": Statistic(CLUSTERS, "V", voltage_rms),
    "share_on_rails": Statistic(CLUSTERS, "", share_on_rails),
    "share_freewheeling": Statistic(CLUSTERS, "", share_freewheeling),
    "heating_rate": Statistic(HEATING, "K/s", heating_rate),
}
