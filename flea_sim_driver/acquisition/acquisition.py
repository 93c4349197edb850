"""The DAQ's slow channels of one block: from true signals to digital values, faults included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_sim_driver.acquisition.sensors import (
    CHANNELS,
    COLUMN,
    ENCODER_COUNTS,
    LOAD_CURRENT_OFFSET_A,
    Instruments,
)
from flea_sim_driver.plant.actuator import Sizes
from flea_sim_driver.plant.drive import Waveform, waveform
from flea_sim_driver.plant.plant import SIGNALS
from flea_sim_driver.plant.thermal import Temperatures
from flea_sim_driver.plant.unit import Bench, SimulatedUnit
from flea_sim_driver.scenario.settings import Sensors
from flea_sim_driver.schedule import FaultCourse

Array = npt.NDArray[np.float64]
SCANS = 10
SCAN_S = 0.01
DEFECTIVE_READING = -24.0
PWM_RUNS_V = 4.0


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

    def column(self, signal: str) -> Array:
        """One plant signal at every step, shape (steps,)."""
        return np.asarray(self.signals[:, SIGNALS.index(signal)])

    def mean(self, signal: str) -> Array:
        """One plant signal averaged over each scan, shape (SCANS,)."""
        return _scan_mean(self.column(signal))


def _scan_mean(values: Array) -> Array:
    return np.asarray(values.reshape(SCANS, -1).mean(axis=1))


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
    bench, panel
        The stand's drive and its instruments.
    generator
        Random numbers for errors after the instruments.
    """

    def __init__(
        self, sensors: Sensors, bench: Bench, panel: Instruments, generator: np.random.Generator
    ) -> None:
        self._sensors, self._bench, self._panel = sensors, bench, panel
        self._generator = generator
        self._phase = float(generator.random())
        self._counts: float | None = None

    def read(self, block: Block, before: Temperatures, after: Temperatures) -> Array:
        """Digital values of the block, shape (SCANS, channels)."""
        true = np.empty((SCANS, len(CHANNELS)))
        self._electrical(true, block)
        self._mechanical(true, block)
        _thermal(true, before, after)
        true[:, COLUMN["commanded_position"]] = _scan_mean(block.position)
        true[:, COLUMN["commanded_load"]] = _scan_mean(block.load)
        running = np.minimum(np.abs(block.mean("voltage")) / PWM_RUNS_V, 1.0)
        values = self._panel.read(true, running)
        if self._sensors.defective:
            noise = 0.05 * self._generator.standard_normal(SCANS)
            values[:, COLUMN[self._sensors.defective]] = DEFECTIVE_READING + noise
        self._falsify(values, block)
        return values

    def _electrical(self, true: Array, block: Block) -> None:
        current, voltage = block.mean("current"), block.mean("voltage")
        if self._sensors.voltage == "instant_pwm":
            time = block.begin_s + np.arange(SCANS) * SCAN_S
            phase = np.mod(self._phase + self._bench.pwm_frequency_hz * time, 1.0)
            wave = pwm(block, self._bench)
            driven = np.abs(voltage) + np.abs(current) > 1e-6
            current = np.where(driven, wave.current(phase), 0.0)
            voltage = np.where(driven, wave.voltage(phase), 0.0)
        true[:, COLUMN["motor_current"]] = current + block.unit.current_offset_a
        true[:, COLUMN["motor_voltage"]] = voltage + block.unit.voltage_offset_v
        true[:, COLUMN["commanded_voltage"]] = block.mean("command")
        true[:, COLUMN["load_motor_current"]] = block.mean("load_current") + LOAD_CURRENT_OFFSET_A

    def _mechanical(self, true: Array, block: Block) -> None:
        position = block.column("position")
        ends = position[len(position) // SCANS - 1 :: len(position) // SCANS]
        counts = np.floor(ends / block.unit.lead_m * ENCODER_COUNTS)
        first = counts[0] if self._counts is None else self._counts
        turned = np.diff(counts, prepend=first)
        self._counts = float(counts[-1])
        true[:, COLUMN["motor_speed"]] = turned * (2.0 * np.pi / ENCODER_COUNTS / SCAN_S)
        encoder = block.mean("position") + self._panel.homing_error_m
        true[:, COLUMN["actuator_position"]] = encoder
        pot = self._panel.potentiometer(block.mean("load_position"))
        true[:, COLUMN["load_position"]] = pot
        true[:, COLUMN["load_force"]] = block.mean("force")

    def _falsify(self, values: Array, block: Block) -> None:
        """Sensor faults, on the digital values."""
        for k, row in enumerate(block.sizes):
            for course, size in zip(block.courses, row, strict=True):
                if size is not None and course.row.channel:
                    column = COLUMN[course.row.channel]
                    age = block.begin_s + k * SCAN_S - course.onset_s
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


def _thermal(true: Array, before: Temperatures, after: Temperatures) -> None:
    share = np.arange(SCANS) / SCANS
    for channel, name in (("motor", "housing_sensed"), ("nut", "nut_sensed")):
        first, last = getattr(before, name), getattr(after, name)
        true[:, COLUMN[f"{channel}_temperature"]] = first + share * (last - first)
    true[:, COLUMN["ambient_temperature"]] = before.ambient
