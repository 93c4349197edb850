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

"""The DAQ's slow channels of one block: from true signals to digital values, faults included."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_sim_driver.acquisition.sensors import Instruments
from flea_sim_driver.acquisition.slow_readings import SlowReadings
from flea_sim_driver.machine.machine import Machine
from flea_sim_driver.plant.actuator import Sizes
from flea_sim_driver.plant.drive import Waveform, waveform
from flea_sim_driver.plant.plant import SIGNALS
from flea_sim_driver.plant.thermal import Temperatures
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.plant.vibration import Severity
from flea_sim_driver.scenario.settings import Sensors
from flea_sim_driver.schedule import FaultCourse

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """True values of one block: plant signals (steps, SIGNALS), temperatures and conditions."""

    begin_s: float
    unit: SimulatedUnit
    signals: Array
    position: Array
    load: Array
    courses: tuple[FaultCourse, ...]
    sizes: list[Sizes]
    """Of each fault, scan by scan."""
    brake: Array = field(default_factory=lambda: np.zeros(1))
    """1 in scans in which the brake is commanded to engage, else 0."""

    def column(self, signal: str) -> Array:
        """One plant signal at every step, shape (steps,)."""
        return np.asarray(self.signals[:, SIGNALS.index(signal)])

    def mean(self, signal: str) -> Array:
        """One plant signal averaged over each scan, shape (scans,)."""
        return self.scan_mean(self.column(signal))

    def scan_mean(self, values: Array) -> Array:
        """Values at every step averaged over each scan, shape (scans,)."""
        return np.asarray(values.reshape(len(self.sizes), -1).mean(axis=1))

    @property
    def severity(self) -> Severity:
        """Vibration sources: the faults present in the middle of the block."""
        middle = self.sizes[len(self.sizes) // 2]
        now = {
            course.row.id: size
            for course, size in zip(self.courses, middle, strict=True)
            if size is not None
        }
        return Severity(
            spall=now.get("spall", 0.0),
            jam=now.get("jam", 0.0),
            friction=now.get("ball_nut_friction", 0.0),
            eccentricity=now.get("rotor_eccentricity", 0.0),
            backlash_m=now.get("backlash", 0.0),
            accelerometers=(now.get("accelerometer_1_fault"), now.get("accelerometer_2_fault")),
        )


def pwm(block: Block, bench: Bench) -> Waveform:
    """The freewheeling drive's PWM period at each scan."""
    unit = block.unit
    return waveform(
        block.mean("current"),
        unit.force_constant_n_per_a * block.mean("speed"),
        unit.winding_resistance_ohm,
        unit.winding_inductance_h * bench.pwm_frequency_hz,
        bench.supply_v,
        bench.freewheel_drop_v,
    )


class Acquisition:
    """Instruments and DAQ of one stand.

    Parameters
    ----------
    sensors
        Options of the scenario.
    machine, panel
        The stand's machine and its instruments.
    generator
        Random numbers for errors after the instruments.
    """

    def __init__(
        self, sensors: Sensors, machine: Machine, panel: Instruments, generator: np.random.Generator
    ) -> None:
        self._sensors, self._machine, self._panel = sensors, machine, panel
        self._bench, self._sampling = machine.bench, machine.sampling
        self._generator = generator
        self._phase = float(generator.random())
        self._counts: float | None = None
        self._slow = SlowReadings(machine)

    def read(self, block: Block, before: Temperatures, after: Temperatures) -> Array:
        """Digital values of the block, shape (scans, channels)."""
        signals = {
            **self._electrical(block),
            **self._mechanical(block),
            **_thermal(len(block.sizes), before, after),
            **self._commands(block),
        }
        true = np.empty((len(block.sizes), len(self._machine.channels)))
        for channel, place in self._machine.column.items():
            true[:, place] = signals[channel]
        running = np.minimum(np.abs(block.mean("voltage")) / self._sampling.pwm_runs_v, 1.0)
        values = self._panel.read(true, running)
        if self._sensors.defective:
            noise = self._sampling.defective_noise * self._generator.standard_normal(len(values))
            place = self._machine.column[self._sensors.defective]
            values[:, place] = self._sampling.defective_reading + noise
        self._falsify(values, block)
        self._slow.hold(values)
        return values

    def _commands(self, block: Block) -> dict[str, Array]:
        """What is commanded; the load of a crank is its moment."""
        load = block.scan_mean(block.load)
        return {
            "commanded_voltage": block.mean("command"),
            "commanded_position": block.scan_mean(block.position),
            "commanded_load": load * (self._bench.crank_radius_m or 1.0),
            "brake_engaged": block.brake,
        }

    def _electrical(self, block: Block) -> dict[str, Array]:
        current, voltage = block.mean("drawn"), block.mean("voltage")
        if self._sensors.voltage == "instant_pwm":
            time = block.begin_s + np.arange(len(block.sizes)) * self._sampling.scan_s
            phase = np.mod(self._phase + self._bench.pwm_frequency_hz * time, 1.0)
            wave = pwm(block, self._bench)
            driven = np.abs(voltage) + np.abs(current) > 1e-6
            current = np.where(driven, wave.current(phase), 0.0)
            voltage = np.where(driven, wave.voltage(phase), 0.0)
        return {
            "motor_current": current + block.unit.current_offset_a,
            "motor_voltage": voltage + block.unit.voltage_offset_v,
            "load_motor_current": block.mean("load_current") + self._sampling.load_current_offset_a,
            "bus_voltage": block.mean("supply"),
        }

    def _mechanical(self, block: Block) -> dict[str, Array]:
        return {
            "motor_speed": self._encoder_speed(block),
            "actuator_position": self._actuator_position(block) + self._panel.homing_error_m,
            **self._load_side(block),
            "load_force": block.mean("force"),
        }

    def _actuator_position(self, block: Block) -> Array:
        """Position of the nut; of the motor where that is what its sensor is mounted on."""
        rows = {row.channel: row for row in self._machine.instruments}
        nut = block.mean("position")
        on_motor = rows["actuator_position"].mount == "motor shaft"
        return nut + block.mean("slipped") if on_motor else nut

    def _encoder_speed(self, block: Block) -> Array:
        """Counts of the motor's encoder over each scan, as a speed in rad/s."""
        position = block.column("position") + block.column("slipped")
        counts = self._sampling.encoder_counts
        steps = len(position) // len(block.sizes)
        turn_m = block.unit.lead_m * block.unit.gear_ratio
        read = np.floor(position[steps - 1 :: steps] / turn_m * counts)
        first = read[0] if self._counts is None else self._counts
        turned = np.diff(read, prepend=first)
        self._counts = float(read[-1])
        return np.asarray(turned * (2.0 * np.pi / counts / self._sampling.scan_s))

    def _load_side(self, block: Block) -> dict[str, Array]:
        """Position of the load side in m, or of what its crank turns in rad."""
        position = block.mean("load_position")
        if self._bench.crank_radius_m == 0.0:
            return {"load_position": self._panel.potentiometer(position)}
        sine = (position - self._bench.load_centre_m) / self._bench.crank_radius_m
        angle = np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)))
        return {"surface_angle": self._panel.potentiometer(angle)}

    def _falsify(self, values: Array, block: Block) -> None:
        """Sensor faults, on the digital values."""
        for k, row in enumerate(block.sizes):
            for course, size in zip(block.courses, row, strict=True):
                if size is not None and course.row.channel:
                    column = self._machine.column[course.row.channel]
                    age = block.begin_s + k * self._sampling.scan_s - course.onset_s
                    values[k, column] = self._false(course, size, float(values[k, column]), age)

    def _false(self, course: FaultCourse, size: float, value: float, age: float) -> float:
        mode = course.row.mode
        if mode == "dropout":
            return 0.0 if course.in_gap(size, course.onset_s + age) else value
        if mode == "noise":
            return value + size * float(self._generator.standard_normal())
        return {
            "bias": value + size,
            "drift": value + size * age,
            "scaling": value * size,
            "dead": size,
        }[mode]


def _thermal(scans: int, before: Temperatures, after: Temperatures) -> dict[str, Array]:
    share = np.arange(scans) / scans

    def between(name: str) -> Array:
        first, last = getattr(before, name), getattr(after, name)
        return np.asarray(first + share * (last - first))

    return {
        "motor_temperature": between("housing_sensed"),
        "nut_temperature": between("nut_sensed"),
        "ambient_temperature": np.full(scans, before.ambient),
    }
