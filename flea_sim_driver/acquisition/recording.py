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

"""Signals of runs of the stand, from the public FLEA recordings or simulated."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.records import Scan
from flea_sim_driver.machine.library import DEFAULT_MACHINE, find_machine
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

Array = npt.NDArray[np.float64]
RATE_HZ = 100.0
NEWTON_PER_POUND = 4.4482216152605
LOW_PASS_HZ = 5.0
FEWEST_SCANS = 1000
NEEDED = [3, 5]
"""Columns of position and load: the simulated counterpart follows them."""
NAME = re.compile(r"BatchProfile_([a-z]+)(\d)(\d)_.*_(Nominal|Jam|Spall)_")

MOTIONS: dict[str, dict[str, float | str]] = {
    # The commands were not recorded: periods and centres are taken from the recordings,
    # amplitudes fitted together with the position loop.
    "sine1": {"kind": "sine", "amplitude_m": 0.023, "frequency_hz": 0.5, "centre_m": 0.0435},
    "sine2": {"kind": "sine", "amplitude_m": 0.0249, "frequency_hz": 1.0, "centre_m": 0.0435},
    "sine3": {"kind": "sine", "amplitude_m": 0.0409, "frequency_hz": 0.25, "centre_m": 0.0445},
    "triang1": {"kind": "triangle", "amplitude_m": 0.0252, "frequency_hz": 0.5, "centre_m": 0.046},
    "triang2": {"kind": "triangle", "amplitude_m": 0.0275, "frequency_hz": 1.0, "centre_m": 0.047},
    "triang3": {"kind": "triangle", "amplitude_m": 0.0435, "frequency_hz": 0.25, "centre_m": 0.047},
    "trap1": {"kind": "trapezoid", "amplitude_m": 0.0231, "frequency_hz": 0.0435, "rise_s": 0.7,
              "centre_m": 0.043},
    "trap2": {"kind": "trapezoid", "amplitude_m": 0.0225, "frequency_hz": 0.0476, "rise_s": 0.55,
              "centre_m": 0.043},
    "trap3": {"kind": "trapezoid", "amplitude_m": 0.0408, "frequency_hz": 0.0417, "rise_s": 2.0,
              "centre_m": 0.050},
    "sweep1": {"kind": "sweep", "amplitude_m": 0.043, "frequency_hz": 0.13,
               "end_frequency_hz": 0.58, "centre_m": 0.043},
}  # fmt: skip


@dataclass(frozen=True)
class RunSignals:
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


def read_real(path: Path) -> RunSignals:
    """One recording; the driven test actuator is Y in nominal runs and X in the others.

    Raises
    ------
    RecordingError
        The name or the content is not that of a FLEA run.
    """
    match = NAME.match(path.name)
    if match is None:
        raise RecordingError(f"{path}: not the name of a nominal, jam or spall FLEA run")
    motion, label = match[1] + match[2], match[4]
    if motion not in MOTIONS:
        raise RecordingError(
            f"{path}: no motion {shown(motion)} is known, there are {', '.join(MOTIONS)}"
        )
    table = _table(path)
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


def _table(path: Path) -> Array:
    """Numbers of a recording, shape (scans, 19); refused if there are too few to compare."""
    try:
        table = np.genfromtxt(path, delimiter="\t", usecols=range(1, 20), ndmin=2)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    if len(table) < FEWEST_SCANS:
        raise RecordingError(f"{path}: {len(table)} scans, at least {FEWEST_SCANS} are compared")
    if not np.isfinite(table[:, NEEDED]).all():
        raise RecordingError(f"{path}: position or load is not measured throughout")
    return table


def _smoothed(
    name: str, motion: str, label: str, signals: dict[str, Array], *, simulated: bool
) -> RunSignals:
    from scipy.signal import butter, sosfiltfilt

    sections = butter(4, LOW_PASS_HZ, fs=RATE_HZ, output="sos")
    smooth = {key: np.asarray(sosfiltfilt(sections, value)) for key, value in signals.items()}
    smooth["speed"] = np.gradient(smooth["position"], 1.0 / RATE_HZ)
    smooth["acceleration"] = np.gradient(smooth["speed"], 1.0 / RATE_HZ)
    return RunSignals(name, motion, label, simulated=simulated, smooth=smooth, **signals)


def counterpart(real: RunSignals, seed: int, unit_spread: float = 1.0) -> Scenario:
    """The scenario that reproduces a recorded run."""
    limit_n = find_machine(DEFAULT_MACHINE).limits.load_n
    load = float(np.clip(np.mean(real.force), -limit_n, limit_n))
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


def simulate(real: RunSignals, seed: int, unit_spread: float = 1.0) -> RunSignals:
    """The simulated counterpart of a run, with the signs of ``Scan``."""
    records = SimulatedStand(counterpart(real, seed, unit_spread))
    values = np.array([record.values for record in records if isinstance(record, Scan)])
    places = find_machine(DEFAULT_MACHINE).column

    def column(channel: str) -> Array:
        return np.asarray(values[:, places[channel]])

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
