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

"""A simulated machine: motor, drive, gear, screw, load side, heat, sensors, limits and faults.

This is the truth of a simulation. No stage of a diagnosis reads it; the description of a stand
holds what an engineer knows of the same machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from flea_diag.fields.values import AboveZero, NotNegative
from flea_sim_driver.plant.disturbance import Catches
from flea_sim_driver.plant.structure import Structure, StructureSpread
from flea_sim_driver.plant.thermal import Heat
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.plant.vibration import Sources

BLOCK_S = 0.1
"""Span of one block of the simulation."""


@dataclass(frozen=True)
class Instrument:
    """One channel: standard deviation, resolution and range in the channel's unit.

    ``running_noise`` is the relative increase of noise while the motor's PWM runs;
    ``spike_share`` of the samples are outliers of scale ``spike``. Between stands the noise
    differs by a log-normal ``noise_spread``, the gain by a normal ``gain_spread``. With a
    ``rate_hz`` the DAQ reads it so often, and holds the reading in between; 0: in every scan.
    """

    channel: str
    unit: str
    noise: float
    resolution: float
    minimum: float
    maximum: float
    running_noise: float = 0.0
    spike_share: float = 0.0
    spike: float = 0.0
    noise_spread: float = 0.0
    gain_spread: float = 0.0
    rate_hz: NotNegative = 0.0
    mount: str = ""
    note: str = ""


@dataclass(frozen=True)
class Sampling:
    """The DAQ: its rate, encoder, position sensors and offsets."""

    scan_rate_hz: AboveZero
    encoder_counts: AboveZero
    """Of one turn of the motor."""
    load_current_offset_a: float
    homing_error_m: float
    potentiometer_wave_m: float
    potentiometer_wave_length_m: AboveZero
    potentiometer_gain_error: float
    pwm_runs_v: AboveZero
    """Voltage at which the noise of the PWM is fully developed."""
    defective_reading: float
    """What a channel shows that is bad from the first sample."""
    defective_noise: float

    @property
    def scan_s(self) -> float:
        """Scan period in s."""
        return 1.0 / self.scan_rate_hz

    @property
    def scan_ns(self) -> int:
        """Scan period in ns."""
        return round(1e9 / self.scan_rate_hz)

    @property
    def scans(self) -> int:
        """Scans in one block."""
        return round(self.scan_rate_hz * BLOCK_S)


@dataclass(frozen=True)
class Limits:
    """What the machine can be asked for, and what it is asked for by default."""

    stroke_m: AboveZero
    load_n: AboveZero
    speed_m_s: AboveZero
    acceleration_m_s2: AboveZero
    jerk_m_s3: AboveZero
    flight_speed_m_s: AboveZero
    flight_acceleration_m_s2: AboveZero
    flight_margin_m: float
    amplitude_m: float
    """Of the motion of a scenario that gives none."""
    centre_m: float
    payload_kg: NotNegative = 0.0


@dataclass(frozen=True)
class DrawnMotion:
    """Ranges, lowest and highest, from which a campaign draws its motions."""

    amplitude_m: tuple[float, float]
    centre_m: tuple[float, float]
    frequency_hz: tuple[float, float]
    trapezoid_hz: tuple[float, float]
    rise_s: AboveZero
    sweep_from_hz: AboveZero
    speed_m_s: AboveZero
    """The frequency is lowered until the peak speed is no higher."""


@dataclass(frozen=True, eq=False)
class Machine:
    """Everything that a simulation needs to know of one machine.

    ``spread`` is one standard deviation of parameters between units, relative, at
    ``unit_spread`` 1. ``faults`` and ``sensor_faults`` hold the numbers of the rows that
    ``flea_sim_driver.faults.catalogue`` makes.
    """

    name: str
    description: str
    unit: SimulatedUnit
    spread: Mapping[str, float]
    bench: Bench
    heat: Heat
    catches: Catches
    structure: Structure
    structure_spread: StructureSpread
    vibration: Sources
    sampling: Sampling
    instruments: tuple[Instrument, ...]
    limits: Limits
    drawn: DrawnMotion
    faults: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    sensor_faults: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Names of the slow channels, in the order of a scan."""
        return tuple(row.channel for row in self.instruments)

    @cached_property
    def column(self) -> dict[str, int]:
        """Name of each channel -> its place in a scan."""
        return {channel: place for place, channel in enumerate(self.channels)}
