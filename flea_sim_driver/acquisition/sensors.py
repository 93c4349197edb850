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

"""The slow channels: from true signals to values of the DAQ.

Noise, resolution, offset, clipping, lag and outliers of each channel stand in the machine's file.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import ChannelInfo
from flea_sim_driver.machine.machine import Machine

Array = npt.NDArray[np.float64]
ACCELEROMETER_AXES = tuple(f"accelerometer_{number}_{axis}" for number in (1, 2) for axis in "xyz")
ON_ACTUATOR = ("motor controller", "motor shaft", "motor housing", "ball screw nut")
"""Mounts on the test actuator, which change with it."""
ACCELEROMETER_MOUNT = {"1": "motor housing", "2": "ball screw nut"}


def channel_infos(
    machine: Machine, voltage: str, vibration_rate_hz: float | None, serial: str = ""
) -> tuple[ChannelInfo, ...]:
    """Rows of the channel table; sensors on the test actuator have its serial number."""
    slow = tuple(
        ChannelInfo(
            row.channel, row.unit, row.minimum, row.maximum, machine.sampling.scan_rate_hz,
            mount=row.mount, note=row.note, serial=serial if row.mount in ON_ACTUATOR else "",
            sampling=voltage if row.channel in ("motor_voltage", "motor_current") else "mean",
        )
        for row in machine.instruments
    )  # fmt: skip
    if vibration_rate_hz is None:
        return slow
    return slow + tuple(
        ChannelInfo(axis, "m/s^2", -500.0, 500.0, vibration_rate_hz, serial, sampling="instant",
                    mount=ACCELEROMETER_MOUNT[axis.split("_")[1]])
        for axis in ACCELEROMETER_AXES
    )  # fmt: skip


class Instruments:
    """All instruments of one stand: their errors, drawn once, and their noise.

    Parameters
    ----------
    machine
        Whose instruments they are.
    drawn, noise
        Random numbers of what differs between stands, and of the noise.
    spread
        Scale of the differences between stands.
    spikes
        Whether there are outliers.
    """

    def __init__(
        self,
        machine: Machine,
        drawn: np.random.Generator,
        noise: np.random.Generator,
        spread: float,
        spikes: bool,
    ) -> None:
        rows, self._sampling = machine.instruments, machine.sampling
        self._generator = noise
        self._noise = np.array([row.noise for row in rows])
        self._running = np.array([row.running_noise for row in rows])
        self._resolution = np.array([row.resolution or 1e-12 for row in rows])
        self._low = np.array([row.minimum for row in rows])
        self._high = np.array([row.maximum for row in rows])
        self._share = np.array([row.spike_share if spikes else 0.0 for row in rows])
        self._spike = np.array([row.spike for row in rows])
        noisy = [place for place, row in enumerate(rows) if row.noise_spread]
        draws = drawn.standard_normal(3 + len(noisy)) * spread
        for place, draw in zip(noisy, draws[3:], strict=True):
            self._noise[place] *= np.exp(rows[place].noise_spread * draw)
        self._gain = np.ones(len(rows))
        for place, row in enumerate(rows):
            if row.gain_spread:
                self._gain[place] += row.gain_spread * spread * drawn.standard_normal()
        self.homing_error_m = self._sampling.homing_error_m * float(draws[0])
        self._pot_phase = float(draws[1])
        self._pot_gain = 1.0 + self._sampling.potentiometer_gain_error * float(draws[2])

    def potentiometer(self, position: Array) -> Array:
        """Position with gain error and non-linearity of the potentiometer track."""
        length = self._sampling.potentiometer_wave_length_m
        wave = np.sin(2.0 * np.pi * position / length + self._pot_phase)
        wave = self._sampling.potentiometer_wave_m * wave
        return np.asarray(position * self._pot_gain + wave)

    def read(self, true: Array, running: Array) -> Array:
        """Values as digitised, from ``true`` (n, channels) and PWM activity 0..1 (n,)."""
        shape = true.shape
        growth = 1.0 + self._running * running[:, None]
        values = true * self._gain + self._noise * growth * self._generator.standard_normal(shape)
        outlier = self._generator.random(shape) < self._share * (0.2 + running[:, None])
        kick = self._generator.standard_normal(shape)
        values = values + np.where(outlier, self._spike * kick, 0.0)
        values = np.round(values / self._resolution) * self._resolution
        return np.asarray(np.clip(values, self._low, self._high))
