"""How like the real stand the simulated one is: the same statistics of both, side by side.

Real runs are text files of the public FLEA recordings; each is simulated with its own motion
and mean load. The simulator was tuned on one half of the runs (``tuning``), the report on the
other half (``held out``) is the honest one.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError
from flea_diag.wire.records import Scan
from flea_sim_driver.scenario import (
    LOAD_LIMIT_N,
    NEWTON_PER_POUND,
    Scenario,
    scenario_from_mapping,
)
from flea_sim_driver.sensors import COLUMN
from flea_sim_driver.stand import Stand

Array = npt.NDArray[np.float64]
RATE_HZ = 100.0
LOW_PASS_HZ = 5.0
MOVING_M_S = 4e-3
NAME = re.compile(r"BatchProfile_([a-z]+)(\d)(\d)_.*_(Nominal|Jam|Spall)_")

MOTIONS: dict[str, dict[str, float | str]] = {
    # The commands were not recorded: periods and centres are read off the recordings,
    # amplitudes fitted together with the position loop.
    "sine1": {"kind": "sine", "amplitude_m": 0.024, "frequency_hz": 0.5, "centre_m": 0.0435},
    "sine2": {"kind": "sine", "amplitude_m": 0.029, "frequency_hz": 1.0, "centre_m": 0.0435},
    "sine3": {"kind": "sine", "amplitude_m": 0.038, "frequency_hz": 0.25, "centre_m": 0.0445},
    "triang1": {"kind": "triangle", "amplitude_m": 0.0255, "frequency_hz": 0.5, "centre_m": 0.046},
    "triang2": {"kind": "triangle", "amplitude_m": 0.0305, "frequency_hz": 1.0, "centre_m": 0.047},
    "triang3": {"kind": "triangle", "amplitude_m": 0.046, "frequency_hz": 0.25, "centre_m": 0.047},
    "trap1": {"kind": "trapezoid", "amplitude_m": 0.0208, "frequency_hz": 0.0435, "rise_s": 0.7,
              "centre_m": 0.043},
    "trap2": {"kind": "trapezoid", "amplitude_m": 0.0225, "frequency_hz": 0.0476, "rise_s": 0.55,
              "centre_m": 0.043},
    "trap3": {"kind": "trapezoid", "amplitude_m": 0.048, "frequency_hz": 0.0417, "rise_s": 2.0,
              "centre_m": 0.050},
    "sweep1": {"kind": "sweep", "amplitude_m": 0.043, "frequency_hz": 0.13,
               "end_frequency_hz": 0.58, "centre_m": 0.043},
}  # fmt: skip


@dataclass(frozen=True)
class Recording:
    """Signals of one run, SI, signs as recorded, shapes (n,)."""

    name: str
    motion: str
    label: str
    position: Array
    force: Array
    current: Array
    voltage: Array
    load_current: Array
    motor_temperature: Array
    nut_temperature: Array
    simulated: bool = False
    smooth: dict[str, Array] = field(default_factory=dict)


def read_real(path: Path) -> Recording:
    """One recording; the driven test actuator is Y in nominal runs and X in the others.

    Raises
    ------
    RecordingError
        The name or the content is none of a FLEA run.
    """
    match = NAME.match(path.name)
    if match is None:
        raise RecordingError(f"{path}: not the name of a nominal, jam or spall FLEA run")
    try:
        table = np.genfromtxt(path, delimiter="\t", usecols=range(1, 20))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read: {error}") from error
    motion, label = match[1] + match[2], match[4]
    unit = 1 if label == "Nominal" else 0
    return _smoothed(
        path.name, motion, label,
        {
            # Positive voltage retracts in the recordings, extends here: voltage and current flip.
            "position": table[:, 3] * 1e-3,
            "force": table[:, 5] * NEWTON_PER_POUND,
            "current": -table[:, 6 + unit],
            "voltage": -table[:, 9 + unit],
            "load_current": table[:, 8],
            "motor_temperature": table[:, 12 + unit],
            "nut_temperature": table[:, 15 + unit],
        },
        simulated=False,
    )  # fmt: skip


def _smoothed(
    name: str, motion: str, label: str, signals: dict[str, Array], *, simulated: bool
) -> Recording:
    from scipy.signal import butter, sosfiltfilt

    sections = butter(4, LOW_PASS_HZ, fs=RATE_HZ, output="sos")
    smooth = {key: np.asarray(sosfiltfilt(sections, value)) for key, value in signals.items()}
    smooth["speed"] = np.gradient(smooth["position"], 1.0 / RATE_HZ)
    smooth["acceleration"] = np.gradient(smooth["speed"], 1.0 / RATE_HZ)
    return Recording(name, motion, label, simulated=simulated, smooth=smooth, **signals)


def counterpart(real: Recording, seed: int, unit_spread: float = 1.0) -> Scenario:
    """The scenario that does what a recorded run did."""
    load = float(np.clip(np.mean(real.force), -LOAD_LIMIT_N, LOAD_LIMIT_N))
    faults = [] if real.label == "Nominal" else [{"fault": real.label.lower(), "onset_s": 0.0}]
    return scenario_from_mapping(
        {
            "name": real.name,
            "seed": seed,
            "duration_s": round(len(real.position) / RATE_HZ, 1),
            "unit_spread": unit_spread,
            "warm_degc": max(float(np.median(real.motor_temperature[:200])) - 23.6, 0.0),
            "motion": MOTIONS[real.motion],
            "load": {"constant_n": load},
            "sensors": {"voltage": "instant_pwm", "vibration": False},
            "faults": faults,
        },
        f"counterpart of {real.name}",
    )


def simulate(real: Recording, seed: int, unit_spread: float = 1.0) -> Recording:
    """The simulated counterpart of a run, with the signs of our Scan."""
    records = Stand(counterpart(real, seed, unit_spread))
    values = np.array([record.values for record in records if isinstance(record, Scan)])

    def column(channel: str) -> Array:
        return np.asarray(values[:, COLUMN[channel]])

    return _smoothed(
        real.name, real.motion, real.label,
        {
            "position": column("load_position"),
            "force": column("load_force"),
            "current": column("motor_current"),
            "voltage": column("motor_voltage"),
            "load_current": column("load_motor_current"),
            "motor_temperature": column("motor_temperature"),
            "nut_temperature": column("nut_temperature"),
        },
        simulated=True,
    )  # fmt: skip


# -- statistics ----------------------------------------------------------------------------

EDGE = slice(200, -50)


def stroke(run: Recording) -> float:
    """Half of the travel between its 1st and 99th percentile, m."""
    low, high = np.percentile(run.smooth["position"][EDGE], [1.0, 99.0])
    return float(0.5 * (high - low))


def peak_speed(run: Recording) -> float:
    """99th percentile of speed, m/s."""
    return float(np.percentile(np.abs(run.smooth["speed"][EDGE]), 99.0))


def _centred(values: Array) -> Array:
    return np.asarray(values - np.median(values))


def current_rms(run: Recording) -> float:
    """Effective current about its offset, A."""
    sign = 1.0 if run.simulated else -1.0
    return float(np.sqrt(np.mean((run.current - sign * 0.32) ** 2)))


def current_ripple(run: Recording) -> float:
    """Standard deviation of the current about its 5 Hz mean, A."""
    return float(np.std((run.current - run.smooth["current"])[EDGE]))


def voltage_rms(run: Recording) -> float:
    """Standard deviation of the 5 Hz mean of the voltage, V."""
    return float(np.std(run.smooth["voltage"][EDGE]))


def share_on_rails(run: Recording) -> float:
    """Share of the voltage samples taken while the bridge was on."""
    return float(np.mean(np.abs(run.voltage) > 20.0))


def share_freewheeling(run: Recording) -> float:
    """Share of the voltage samples within 1.5 V of the middle cluster."""
    return float(np.mean(np.abs(_centred(run.voltage)) < 1.5))


def load_rms(run: Recording) -> float:
    """Standard deviation of the load, N."""
    return float(np.std(run.force[EDGE]))


def load_peak(run: Recording) -> float:
    """99.9th percentile of the load's magnitude, N."""
    return float(np.percentile(np.abs(run.force), 99.9))


def load_roughness(run: Recording) -> float:
    """Standard deviation of the load about its 5 Hz mean, N."""
    return float(np.std((run.force - run.smooth["force"])[EDGE]))


def load_current_rms(run: Recording) -> float:
    """Standard deviation of the load motor's current, A."""
    return float(np.std(run.load_current[EDGE]))


def _balance(run: Recording) -> Array:
    """Drive force less load, regressed on 1, sgn v, v, a: N, N, N s/m, kg."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    moving = np.abs(cut["speed"]) > MOVING_M_S
    drive = 176.7 * cut["current"] - cut["force"]
    columns = np.column_stack(
        [np.ones_like(drive), np.sign(cut["speed"]), cut["speed"], cut["acceleration"]]
    )
    solution, *_ = np.linalg.lstsq(columns[moving], drive[moving], rcond=None)
    return np.asarray(solution)


def friction_force(run: Recording) -> float:
    """Loss of the drive over its path, N."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    drive = 176.7 * (cut["current"] - _balance(run)[0] / 176.7) - cut["force"]
    travelled = np.sum(np.abs(cut["speed"]))
    return float(np.sum(drive * cut["speed"]) / travelled)


def resistance(run: Recording) -> float:
    """Winding resistance regressed from V - K v = R i + constant, ohm; NaN on a bad channel."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    columns = np.column_stack([cut["current"], cut["speed"], np.ones_like(cut["speed"])])
    solution, *_ = np.linalg.lstsq(columns, cut["voltage"], rcond=None)
    misfit = cut["voltage"] - columns @ solution
    usable = float(np.std(misfit)) < 2.0
    return float(solution[0]) if usable else float("nan")


def back_emf(run: Recording) -> float:
    """Back-EMF constant of the same regression, V s/m."""
    cut = {key: value[EDGE] for key, value in run.smooth.items()}
    columns = np.column_stack([cut["current"], cut["speed"], np.ones_like(cut["speed"])])
    solution, *_ = np.linalg.lstsq(columns, cut["voltage"], rcond=None)
    usable = float(np.std(cut["voltage"] - columns @ solution)) < 2.0
    return float(solution[1]) if usable else float("nan")


def motor_temperature_noise(run: Recording) -> float:
    """Robust standard deviation of the motor's thermocouple about its 5 Hz mean, K."""
    return _robust(run.motor_temperature - run.smooth["motor_temperature"])


def nut_temperature_noise(run: Recording) -> float:
    """The same of the nut's thermocouple, K."""
    return _robust(run.nut_temperature - run.smooth["nut_temperature"])


def _robust(values: Array) -> float:
    return float(1.4826 * np.median(np.abs(_centred(values))))


def pwm_line(run: Recording) -> float:
    """Frequency of the strongest line of the voltage between 8 and 16 Hz, Hz."""
    values = (run.voltage - run.smooth["voltage"]) * np.hanning(len(run.voltage))
    spectrum = np.abs(np.fft.rfft(values))
    frequency = np.fft.rfftfreq(len(values), 1.0 / RATE_HZ)
    band = (frequency > 8.0) & (frequency < 16.0)
    return float(frequency[band][np.argmax(spectrum[band])])


STATISTICS: dict[str, tuple[Callable[[Recording], float], str]] = {
    "stroke": (stroke, "m"),
    "peak_speed": (peak_speed, "m/s"),
    "current_rms": (current_rms, "A"),
    "current_ripple": (current_ripple, "A"),
    "voltage_rms": (voltage_rms, "V"),
    "share_on_rails": (share_on_rails, ""),
    "share_freewheeling": (share_freewheeling, ""),
    "load_rms": (load_rms, "N"),
    "load_peak": (load_peak, "N"),
    "load_roughness": (load_roughness, "N"),
    "load_current_rms": (load_current_rms, "A"),
    "friction_force": (friction_force, "N"),
    "resistance": (resistance, "ohm"),
    "back_emf": (back_emf, "V s/m"),
    "motor_temperature_noise": (motor_temperature_noise, "K"),
    "nut_temperature_noise": (nut_temperature_noise, "K"),
    "pwm_line": (pwm_line, "Hz"),
}


@dataclass(frozen=True)
class Comparison:
    """One statistic of one run: real, simulated, and the distance |ln(sim / real)|."""

    run: str
    label: str
    half: str
    statistic: str
    unit: str
    real: float
    simulated: float

    @property
    def distance(self) -> float:
        """Magnitude of the log ratio: 0.1 is ten per cent; NaN where the real one is unusable."""
        if not (self.real > 0.0 and self.simulated > 0.0):
            return float("nan")
        return abs(float(np.log(self.simulated / self.real)))


def compare(
    paths: list[Path], seed: int, keep: Callable[[Recording, Recording], None] | None = None
) -> list[Comparison]:
    """All statistics of all runs; every other run of a label is held out."""
    rows: list[Comparison] = []
    seen: dict[str, int] = {}
    for number, path in enumerate(sorted(paths)):
        real = read_real(path)
        count = seen[real.label] = seen.get(real.label, 0) + 1
        half = "tuning" if count % 2 else "held out"
        simulated = simulate(real, seed + number)
        rows += [
            Comparison(real.name, real.label, half, name, unit, get(real), get(simulated))
            for name, (get, unit) in STATISTICS.items()
        ]
        if keep is not None:
            keep(real, simulated)
    return rows
