"""Kalman filter of one temperature, driven by what heats the node and what cools it.

    T' = q - (T - T_ambient) / tau

A temperature hardly wanders by itself: particles would all descend from one first guess, and
given the heat the node is linear. So the observer samples the motion and keeps each
temperature as one Gaussian (Rao-Blackwellisation, with the heat of the mean current).
"""

from __future__ import annotations

import math

START_K = 10.0
"""Standard deviation of the first reading: thermocouples begin with a spike now and then."""


class ThermalFilter:
    """Estimate of one temperature, degC.

    Parameters
    ----------
    cooling_s
        Time constant towards the ambient temperature.
    period_s
        Between scans.
    walk_k, reading_k
        Standard deviations of what one scan adds unknown, and of one reading.
    """

    def __init__(self, cooling_s: float, period_s: float, walk_k: float, reading_k: float) -> None:
        self._cooling = period_s / cooling_s
        self._period_s = period_s
        self._walk = walk_k**2
        self._reading = reading_k**2
        self.estimate_degc = math.nan
        self._variance = START_K**2

    def state(self) -> list[float]:
        """Estimate, variance, and the constants of a scan, as ``heat_loops`` takes them."""
        constants = [self._period_s, self._cooling, self._walk, self._reading]
        return [self.estimate_degc, self._variance, *constants]

    def take(self, estimate_degc: float, variance: float) -> None:
        """What ``heat_loops`` has made of them."""
        self.estimate_degc, self._variance = estimate_degc, variance

    def step(
        self,
        measured_degc: float,
        heating_k_per_s: float,
        ambient_degc: float,
        frozen: bool,
    ) -> tuple[float, float, float]:
        """Advance by one scan.

        Returns
        -------
        prediction, residual, sigma
            NaN before the first reading, residual also without a reading.
        """
        if math.isnan(self.estimate_degc):
            self.estimate_degc = measured_degc
            return math.nan, math.nan, math.nan
        if not math.isnan(heating_k_per_s):
            self.estimate_degc += self._period_s * heating_k_per_s
        if not math.isnan(ambient_degc):
            self.estimate_degc -= self._cooling * (self.estimate_degc - ambient_degc)
        self._variance += self._walk
        prediction = self.estimate_degc
        residual = measured_degc - prediction
        total = self._variance + self._reading
        if not frozen and not math.isnan(residual):
            gain = self._variance / total
            self.estimate_degc += gain * residual
            self._variance -= gain * self._variance
        return prediction, residual, math.sqrt(total)
