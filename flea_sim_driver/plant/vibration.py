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

"""Acceleration on the motor housing and on the nut, block by block.

Events are indexed in screw angle, never in time: balls pass a pit of the nut's raceway
``ball_pass_order`` times a revolution, with a slip that adds up (McFadden and Smith 1984;
Antoni and Randall 2003). Each excitation rings the modes of the structure that it acts on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.fields.values import AboveZero
from flea_sim_driver.plant.structure import Structure
from flea_sim_driver.plant.unit import SimulatedUnit

Array = npt.NDArray[np.float64]
IMPULSE_RATE_HZ = 20_000.0
"""Reference rate of impulses: their size is that of one sample at this rate."""
LEAST_GAP_M = 5e-5
"""Gap from which the coupling knocks beyond its usual play."""


@dataclass(frozen=True)
class Sources:
    """Strength of each source at the references of speed, load and gap, in m/s^2.

    Sizes of faults multiply ``spall``, ``jam``, ``friction`` and ``eccentricity``.
    """

    speed_rad_s: AboveZero
    """Reference speed of the screw."""
    load_n: AboveZero
    least_load_n: float
    unbalance_speed_rad_s: AboveZero
    gap_m: AboveZero
    motor: float
    motor_at_rest: float
    nut: float
    nut_at_rest: float
    nut_unloaded: float
    """Share of the nut's noise that does not depend on the load."""
    ball_pass: float
    ball_slip: float
    unbalance: float
    knock: float
    spall: float
    jam: float
    friction: float
    eccentricity: float
    wide_knock: float
    sensor_noise: float
    crosstalk: float
    amplitude_limit: AboveZero
    motor_axes: tuple[float, float, float]
    """Gain of each axis of the accelerometer on the motor housing."""
    nut_axes: tuple[float, float, float]


def balls_per_turn(unit: SimulatedUnit) -> float:
    """Balls in one turn of the nut."""
    helix = np.arctan(unit.lead_m / (np.pi * unit.screw_pitch_diameter_m))
    turn = np.pi * unit.screw_pitch_diameter_m / np.cos(helix)
    return float(turn / (unit.ball_spacing * unit.ball_diameter_m))


def ball_pass_order(unit: SimulatedUnit) -> float:
    """Balls that pass a point of the nut, per revolution of the screw."""
    gamma = unit.ball_diameter_m * np.cos(unit.contact_angle_rad) / unit.screw_pitch_diameter_m
    return float(0.5 * balls_per_turn(unit) * (1.0 - gamma))


@dataclass(frozen=True)
class Severity:
    """Present strength of each vibration source, in the sizes of the fault catalogue."""

    spall: float = 0.0
    jam: float = 0.0
    friction: float = 0.0
    eccentricity: float = 0.0
    backlash_m: float = 0.0
    accelerometers: tuple[float | None, float | None] = (None, None)


class Vibration:
    """The two accelerometers of one test actuator.

    Parameters
    ----------
    generator
        Random numbers.
    sources
        Strength of each source.
    structure
        Structural response of this actuator.
    rate_hz, count
        Sampling rate, and samples per block.
    """

    def __init__(
        self,
        generator: np.random.Generator,
        sources: Sources,
        structure: Structure,
        rate_hz: float,
        count: int,
    ) -> None:
        self._generator, self._sources = generator, sources
        self._axis_gain = np.array([sources.motor_axes, sources.nut_axes]).reshape(6, 1)
        self._background = structure.background
        self.rate_hz = rate_hz
        self.count = count
        from scipy.fft import next_fast_len  # slow to import: for those who have accelerometers

        ring = structure.impulse_responses(rate_hz)
        self._length = next_fast_len(count + ring.shape[1], real=True)
        self._transfer = np.repeat(np.fft.rfft(ring, self._length), 3, axis=0)
        self._tail = np.zeros((6, ring.shape[1]))
        self._impulse = float(np.sqrt(rate_hz / IMPULSE_RATE_HZ))
        self._travel = 0.0
        self._next_event = 0.0
        self._side = 0.0

    def block(
        self, unit: SimulatedUnit, speed: Array, angle: Array, force: Array, severity: Severity
    ) -> Array:
        """One block of acceleration in m/s^2, shape (count, 6).

        ``speed`` (m/s), ``angle`` (rad) and ``force`` (N) span the block at any uniform rate.
        """
        grid = np.linspace(0.0, 1.0, self.count, endpoint=False)
        knots = (np.arange(len(speed)) + 0.5) / len(speed)
        omega = np.interp(grid, knots, speed) / unit.screw_ratio_m_rad
        theta = np.interp(grid, knots, angle)
        load = np.abs(np.interp(grid, knots, force))
        of = self._sources
        pace = np.abs(omega) / of.speed_rad_s
        at_motor, at_nut = self._background
        motor = at_motor * (of.motor * pace + of.motor_at_rest) * self._white(3)
        loaded = (1.0 - of.nut_unloaded) * (load / of.load_n) ** 0.7
        hum = (of.nut * pace + of.nut_at_rest) * (of.nut_unloaded + loaded)
        nut = at_nut * hum * self._white(3)
        nut += self._wear(pace, severity)
        impacts = self._ball_pass(omega, load, pace, unit, severity.spall)
        knock = self._knocks(force, unit.backlash_m + severity.backlash_m)
        return self._sensed(
            self._ringing(motor + 0.5 * knock, nut + impacts + knock)
            + self._unbalance(
                omega / unit.gear_ratio, theta / unit.gear_ratio, severity.eccentricity
            ),
            severity.accelerometers,
        )

    def _white(self, rows: int) -> Array:
        return self._generator.standard_normal((rows, self.count), dtype=np.float32).astype(float)

    def _wear(self, pace: Array, severity: Severity) -> Array:
        """Jam: bursts of rubbing, not synchronous with rotation. Lost lubrication: steady noise."""
        source = self._white(3)
        level = (
            severity.friction
            * self._sources.friction
            * np.minimum(pace, 1.0) ** 0.4
            * (pace > 0.005)
        )
        if severity.jam > 0.0:
            # A first-order gate, opened at random a few times a second.
            steps = self._generator.random(10) < 0.3
            heights = np.where(steps, self._generator.exponential(1.0, 10), 0.15)
            burst = np.repeat(heights, -(-self.count // 10))[: self.count]
            level = level + self._sources.jam * severity.jam * np.minimum(pace, 1.5) ** 0.7 * burst
        return np.asarray(level * source)

    def _ball_pass(
        self, omega: Array, load: Array, pace: Array, unit: SimulatedUnit, spall: float
    ) -> Array:
        """Impulses where the travelled angle passes the next event; weak on a healthy nut."""
        travel = self._travel + np.cumsum(np.abs(omega)) / self.rate_hz
        out = np.zeros(self.count)
        of = self._sources
        spacing = 2.0 * np.pi / ball_pass_order(unit)
        while self._next_event <= travel[-1]:
            at = min(int(np.searchsorted(travel, self._next_event)), self.count - 1)
            slip, scatter = self._generator.standard_normal(2)
            zone = (max(load[at], of.least_load_n) / of.load_n) ** 0.7
            size = (
                (of.ball_pass + of.spall * spall) * pace[at] ** 1.2 * zone * (1.0 + 0.2 * scatter)
            )
            out[at] += self._impulse * size
            self._next_event += spacing * max(1.0 + of.ball_slip * slip, 0.5)
        self._travel = float(travel[-1])
        return out

    def _knocks(self, force: Array, gap: float) -> Array:
        """An impact each time the coupling force changes from one side of the gap to the other."""
        of, out = self._sources, np.zeros(self.count)
        sides = np.sign(force)
        for k in np.flatnonzero(sides):
            if self._side and sides[k] != self._side:
                at = int((k + 0.5) / len(force) * self.count)
                size = of.knock + of.wide_knock * (gap / of.gap_m) ** 0.5 * (gap > LEAST_GAP_M)
                out[at] += self._impulse * sides[k] * size
            self._side = float(sides[k])
        return out

    def _unbalance(self, omega: Array, theta: Array, eccentricity: float) -> Array:
        """Once per revolution, growing with the square of speed; stronger at the motor."""
        of = self._sources
        level = of.unbalance + of.eccentricity * eccentricity
        level = level * (omega / of.unbalance_speed_rad_s) ** 2
        phases = np.array([0.0, 0.5 * np.pi, 0.25 * np.pi])
        waves = level * np.sin(theta + phases[:, None])
        return np.vstack([waves, 0.6 * waves])

    def _ringing(self, motor: Array, nut: Array) -> Array:
        """Excitations (3, count) at motor and nut, through the structure: (6, count)."""
        share = self._sources.crosstalk
        sources = np.vstack([motor + share * nut, nut + share * motor])
        sources *= self._axis_gain
        spectra = np.fft.rfft(sources, self._length)
        spectra *= self._transfer
        rung = np.fft.irfft(spectra, self._length)
        keep = self._tail.shape[1]
        rung[:, :keep] += self._tail
        self._tail = rung[:, self.count : self.count + keep].copy()
        return np.asarray(rung[:, : self.count])

    def _sensed(self, acceleration: Array, faults: tuple[float | None, float | None]) -> Array:
        noise = self._white(6)
        sensed = acceleration + self._sources.sensor_noise * noise
        for number, size in enumerate(faults):
            rows = slice(3 * number, 3 * number + 3)
            if size == 0.0:
                sensed[rows] = 0.0
            elif size is not None:
                sensed[rows] += size * self._white(3)
        limit = self._sources.amplitude_limit
        return np.asarray(np.clip(sensed, -limit, limit).T)
