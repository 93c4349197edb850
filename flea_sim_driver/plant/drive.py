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

"""A slow freewheeling PWM drive as sampled by a DAQ every 10 ms.

The public FLEA recordings undersample the bridge: the lines at 11.7 Hz are aliases of the PWM. One
apparent period shows the bridge on (supply), freewheeling through its diodes (just below zero)
until the current is zero, then floating at the back-EMF. These periods determine the product of
inductance and PWM frequency, about 1.3 ohm; each alone is an assumption.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
BISECTIONS = 30
RC_TAIL_PERIODS = 0.03


@dataclass(frozen=True)
class Waveform:
    """One PWM period at each instant: shares of the period, levels and peak; shapes (n,)."""

    way: Array
    on: Array
    freewheel: Array
    peak_a: Array
    valley_a: Array
    supply_v: float
    drop_v: Array
    emf_v: Array

    def current(self, phase: Array) -> Array:
        """Winding current in A at a phase in 0..1 of the period."""
        rise = self.valley_a + (self.peak_a - self.valley_a) * phase / self.on
        fall = self.peak_a + (self.valley_a - self.peak_a) * (phase - self.on) / self.freewheel
        in_rest = phase > self.on + self.freewheel
        shape = np.where(phase < self.on, rise, np.where(in_rest, 0.0, fall))
        return np.asarray(self.way * shape)

    def voltage(self, phase: Array) -> Array:
        """Terminal voltage in V at a phase, with the tails of the sensor's RC filter."""
        rest = np.maximum(1.0 - self.on - self.freewheel, 0.0)
        shares = (self.on, self.freewheel, rest)
        levels = (np.full_like(phase, self.supply_v), -self.drop_v, self.emf_v)
        tails = [_tail(share) for share in shares]
        # The filter starts each period in its state at the end of the last.
        end = np.zeros_like(phase)
        for level, tail in zip(levels, tails, strict=True):
            end = level + (end - level) * tail
        value = end / (1.0 - tails[0] * tails[1] * tails[2])
        begin, shape = np.zeros_like(phase), np.zeros_like(phase)
        for level, tail, share in zip(levels, tails, shares, strict=True):
            here = level + (value - level) * _tail(phase - begin)
            shape = np.where(phase >= begin, here, shape)
            value = level + (value - level) * tail
            begin = begin + share
        return np.asarray(self.way * shape)

    def mean_square_current(self) -> Array:
        """Mean square of the current over one period, A^2."""
        peak, valley = self.peak_a, self.valley_a
        return np.asarray((self.on + self.freewheel) * (peak**2 + peak * valley + valley**2) / 3.0)


def _tail(periods: Array) -> Array:
    return np.asarray(np.exp(-np.maximum(periods, 0.0) / RC_TAIL_PERIODS))


def waveform(
    mean_a: Array, emf_v: Array, resistance: float, reactance: float, supply_v: float, drop_v: float
) -> Waveform:
    """The PWM period that carries a mean current against a back-EMF.

    ``reactance`` is inductance times PWM frequency, ohm. The duty is found by bisection: the
    mean current of a discontinuous triangle rises with it.
    """
    way = np.where(mean_a >= 0.0, 1.0, -1.0)
    wanted, emf = np.abs(mean_a), way * emf_v
    low, high = np.full_like(wanted, 1e-4), np.full_like(wanted, 1.0)
    for _ in range(BISECTIONS):
        duty = 0.5 * (low + high)
        _, _, mean = _triangle(duty, emf, resistance, reactance, supply_v, drop_v)
        low, high = np.where(mean < wanted, duty, low), np.where(mean < wanted, high, duty)
    # If the current never reaches zero, the mean voltage sets the duty, and the triangle has an
    # offset.
    carried = (resistance * wanted + emf + drop_v) / (supply_v + drop_v)
    duty = np.clip(np.minimum(0.5 * (low + high), carried), 1e-4, 1.0)
    peak, freewheel, mean = _triangle(duty, emf, resistance, reactance, supply_v, drop_v)
    continuous = freewheel >= 1.0 - duty - 1e-9
    swing = np.maximum(supply_v - emf - resistance * wanted, 0.0) * duty / reactance
    # Driven backwards fast enough to generate its current, the bridge only chops: no triangle.
    dragged = carried <= 0.0
    swing = np.where(dragged, 0.0, swing)
    continuous = continuous | dragged
    freewheel = np.where(dragged, 1.0 - duty, freewheel)
    valley = np.where(continuous, np.maximum(wanted - 0.5 * swing, 0.0), 0.0)
    top = np.where(continuous, wanted + 0.5 * swing, peak)
    drop = np.where(dragged, -(resistance * wanted + emf), drop_v)
    return Waveform(way, duty, freewheel, top, valley, supply_v, drop, emf)


def _triangle(
    duty: Array, emf: Array, resistance: float, reactance: float, supply_v: float, drop_v: float
) -> tuple[Array, Array, Array]:
    """Peak, freewheeling share and mean of the triangle of one duty."""
    drive = np.maximum(supply_v - emf, 0.1)
    peak = drive * duty / (reactance + 0.5 * resistance * duty)
    against = np.maximum(drop_v + emf + 0.5 * resistance * peak, 0.05)
    freewheel = np.minimum(peak * reactance / against, 1.0 - duty)
    return peak, np.maximum(freewheel, 1e-6), 0.5 * peak * (duty + freewheel)
