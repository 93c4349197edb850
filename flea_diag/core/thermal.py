"""One-node thermal model of the motor and of the nut, driven by what heats them.

    T' = q - (T - T_ambient) / tau        q = h_m (i - i0)^2   or   h_n |friction force * speed|

Slowly corrected towards the sensor (``CORRECTION_S``), since a node's true history before
the recording is unknown; the correction is frozen once a fault has been detected, so that a
sensor fault does not smear into the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

CORRECTION_S = 15.0
"""Slow against a step or a drift of a sensor, fast against what heat alone can do."""


class ThermalNode:
    """Estimate of one temperature in degC; starts at the mean of its first readings."""

    def __init__(self, cooling_s: float, start_samples: int) -> None:
        self._cooling_s = cooling_s
        self._start_samples = start_samples
        self._start_sum = 0.0
        self._started = 0
        self.estimate_degc = math.nan

    def step(
        self,
        measured_degc: float,
        heating_k_per_s: float,
        ambient_degc: float,
        dt_s: float,
        frozen: bool,
    ) -> float:
        """Advance by one scan; returns measured less estimate, NaN until started."""
        if self._started < self._start_samples:
            return self._start(measured_degc)
        rate = 0.0 if math.isnan(heating_k_per_s) else heating_k_per_s
        if not math.isnan(ambient_degc):
            rate -= (self.estimate_degc - ambient_degc) / self._cooling_s
        residual = measured_degc - self.estimate_degc
        self.estimate_degc += dt_s * rate
        if not frozen and not math.isnan(residual):
            self.estimate_degc += residual * dt_s / CORRECTION_S
        return residual

    def follow(
        self,
        measured_degc: Sequence[float],
        heating_k_per_s: Sequence[float],
        ambient_degc: Sequence[float],
        dt_s: float,
        frozen: bool,
    ) -> tuple[list[float], list[float]]:
        """``step`` for many scans: the residual of each, and the estimate before it."""
        residuals, before = [], []
        for measured, heating, ambient in zip(
            measured_degc, heating_k_per_s, ambient_degc, strict=True
        ):
            before.append(self.estimate_degc)
            residuals.append(self.step(measured, heating, ambient, dt_s, frozen))
        return residuals, before

    def _start(self, measured_degc: float) -> float:
        if not math.isnan(measured_degc):
            self._start_sum += measured_degc
            self._started += 1
            self.estimate_degc = self._start_sum / self._started
        return math.nan
