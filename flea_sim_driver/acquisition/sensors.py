"""The slow channels: from true signals to values of the DAQ.

Noise, resolution, offset, clipping, lag and outliers were measured on the public FLEA recordings
where they contain the channel; those of encoder and speed are assumptions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.wire.records import ChannelInfo

Array = npt.NDArray[np.float64]
SCAN_RATE_HZ = 100.0


@dataclass(frozen=True)
class Instrument:
    """One channel: standard deviation, resolution and range in the channel's unit.

    ``running_noise`` is the relative increase of noise while the motor's PWM runs;
    ``spike_share`` of the samples are outliers of scale ``spike``.
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
    mount: str = ""
    note: str = ""


ENCODER_COUNTS = 4000
INSTRUMENTS: tuple[Instrument, ...] = (
    Instrument("motor_current", "A", 0.053, 0.00087, -20.0, 20.0, mount="motor controller",
               note="hall sensor with a constant offset"),
    Instrument("motor_voltage", "V", 0.05, 0.0015, -50.0, 50.0, mount="motor controller",
               note="with a constant offset"),
    Instrument("commanded_voltage", "V", 0.0, 0.001, -30.0, 30.0, mount="controller"),
    Instrument("motor_speed", "rad/s", 0.0, 0.0, -500.0, 500.0, mount="motor shaft",
               note="counts of the encoder over one scan"),
    Instrument("actuator_position", "m", 1e-6, 8e-7, -0.02, 0.12, mount="motor shaft",
               note="encoder times screw lead, homed at start"),
    Instrument("load_position", "m", 0.06e-3, 0.0036e-3, 0.0, 0.1, mount="load actuator screw",
               note="linear potentiometer"),
    Instrument("load_force", "N", 1.8, 0.12, -1400.0, 1400.0, running_noise=0.3,
               mount="between load and test actuator"),
    Instrument("motor_temperature", "degC", 0.40, 0.01, -50.0, 400.0, 0.6, 0.004, 5.0,
               mount="motor housing", note="thermocouple"),
    Instrument("nut_temperature", "degC", 0.62, 0.01, -50.0, 400.0, 0.6, 0.004, 7.0,
               mount="ball screw nut", note="thermocouple"),
    Instrument("ambient_temperature", "degC", 0.003, 0.001, -50.0, 100.0, mount="stand"),
    Instrument("commanded_position", "m", 0.0, 1e-7, 0.0, 0.1, mount="controller"),
    Instrument("commanded_load", "N", 0.0, 1e-3, -400.0, 400.0, mount="controller"),
    Instrument("load_motor_current", "A", 0.053, 0.00087, -20.0, 20.0,
               mount="load motor controller", note="hall sensor with a constant offset"),
)  # fmt: skip
CHANNELS = tuple(row.channel for row in INSTRUMENTS)
COLUMN = {channel: column for column, channel in enumerate(CHANNELS)}
LOAD_CURRENT_OFFSET_A = 0.33
POT_NONLINEARITY_M = 0.04e-3
HOMING_ERROR_M = 0.05e-3
ACCELEROMETER_AXES = tuple(f"accelerometer_{number}_{axis}" for number in (1, 2) for axis in "xyz")
ON_ACTUATOR = ("motor controller", "motor shaft", "motor housing", "ball screw nut")
"""Mounts on the test actuator, which change with it."""
ACCELEROMETER_MOUNT = {"1": "motor housing", "2": "ball screw nut"}


def channel_infos(
    voltage: str, vibration_rate_hz: float | None, serial: str = ""
) -> tuple[ChannelInfo, ...]:
    """Rows of the channel table; sensors on the test actuator have its serial number."""
    slow = tuple(
        ChannelInfo(
            row.channel, row.unit, row.minimum, row.maximum, SCAN_RATE_HZ,
            mount=row.mount, note=row.note, serial=serial if row.mount in ON_ACTUATOR else "",
            sampling=voltage if row.channel in ("motor_voltage", "motor_current") else "mean",
        )
        for row in INSTRUMENTS
    )  # fmt: skip
    if vibration_rate_hz is None:
        return slow
    return slow + tuple(
        ChannelInfo(axis, "m/s^2", -500.0, 500.0, vibration_rate_hz, serial, sampling="instant",
                    mount=ACCELEROMETER_MOUNT[axis.split("_")[1]])
        for axis in ACCELEROMETER_AXES
    )  # fmt: skip


class Instruments:
    """All instruments of one stand: their errors, drawn once, and their noise."""

    def __init__(self, generator: np.random.Generator, spread: float, spikes: bool) -> None:
        self._generator = generator
        self._noise = np.array([row.noise for row in INSTRUMENTS])
        self._running = np.array([row.running_noise for row in INSTRUMENTS])
        self._resolution = np.array([row.resolution or 1e-12 for row in INSTRUMENTS])
        self._low = np.array([row.minimum for row in INSTRUMENTS])
        self._high = np.array([row.maximum for row in INSTRUMENTS])
        self._share = np.array([row.spike_share if spikes else 0.0 for row in INSTRUMENTS])
        self._spike = np.array([row.spike for row in INSTRUMENTS])
        draws = generator.standard_normal(5) * spread
        self._noise[COLUMN["motor_temperature"]] *= np.exp(0.12 * draws[3])
        self._noise[COLUMN["nut_temperature"]] *= np.exp(0.40 * draws[4])
        self.homing_error_m = HOMING_ERROR_M * float(draws[0])
        self._pot_phase = float(draws[1])
        self._pot_gain = 1.0 + 5e-4 * float(draws[2])

    def potentiometer(self, position: Array) -> Array:
        """Position with gain error and non-linearity of the potentiometer track."""
        wave = POT_NONLINEARITY_M * np.sin(2.0 * np.pi * position / 0.07 + self._pot_phase)
        return np.asarray(position * self._pot_gain + wave)

    def read(self, true: Array, running: Array) -> Array:
        """Values as digitised, from ``true`` (n, channels) and PWM activity 0..1 (n,)."""
        shape = true.shape
        growth = 1.0 + self._running * running[:, None]
        values = true + self._noise * growth * self._generator.standard_normal(shape)
        outlier = self._generator.random(shape) < self._share * (0.2 + running[:, None])
        kick = self._generator.standard_normal(shape)
        values = values + np.where(outlier, self._spike * kick, 0.0)
        values = np.round(values / self._resolution) * self._resolution
        return np.asarray(np.clip(values, self._low, self._high))
