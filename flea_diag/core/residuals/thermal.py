"""One-node thermal model of the motor and of the nut, driven by what heats them.

    T' = q - (T - T_ambient) / tau        q = h_m (i - i0)^2   or   h_n |friction force * speed|

Slowly corrected towards the sensor (``CORRECTION_S``), since a node's true history before
the recording is unknown; the correction is frozen once a fault has been detected, so that a
sensor fault does not smear into the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

CORRECTION_S = 15.0
"""Slow against a step or a drift of a sensor, fast against what heat alone can do."""


OF_THERMAL_NODES = (
    "motor_heating_k_per_a2s",
    "motor_cooling_s",
    "nut_heating_k_per_j",
    "nut_cooling_s",
)
"""Parameters of the two nodes, which are no relations."""

ESTIMATE, SUM, STARTED, COOLING_S, SAMPLES = range(5)
"""Places in the state of a node."""


def advance(
    node: Any,
    measured_degc: float,
    heating_k_per_s: float,
    ambient_degc: float,
    dt_s: float,
    frozen: bool,
) -> float:
    """Take the state of a node on by one scan; measured less estimate, NaN until it is started.

    It is any sequence of five numbers that can be changed; numba compiles these lines, too.
    """
    if node[STARTED] < node[SAMPLES]:
        if not math.isnan(measured_degc):
            node[SUM] += measured_degc
            node[STARTED] += 1.0
            node[ESTIMATE] = node[SUM] / node[STARTED]
        return math.nan
    rate = 0.0 if math.isnan(heating_k_per_s) else heating_k_per_s
    if not math.isnan(ambient_degc):
        rate -= (node[ESTIMATE] - ambient_degc) / node[COOLING_S]
    residual: float = measured_degc - node[ESTIMATE]
    node[ESTIMATE] += dt_s * rate
    if not frozen and not math.isnan(residual):
        node[ESTIMATE] += residual * dt_s / CORRECTION_S
    return residual


class ThermalNode:
    """Estimate of one temperature; starts at the mean of its first readings."""

    def __init__(self, cooling_s: float, start_samples: int) -> None:
        self.state = np.array([math.nan, 0.0, 0.0, cooling_s, float(start_samples)])

    @property
    def estimate_degc(self) -> float:
        """NaN before the first reading."""
        return float(self.state[ESTIMATE])

    def follow(
        self,
        measured_degc: Sequence[float],
        heating_k_per_s: Sequence[float],
        ambient_degc: Sequence[float],
        dt_s: float,
        frozen: bool,
    ) -> tuple[list[float], list[float]]:
        """``advance`` for many scans: the residual of each, and the estimate before it."""
        node, residuals, before = self.state.tolist(), [], []
        for scan in zip(measured_degc, heating_k_per_s, ambient_degc, strict=True):
            before.append(node[ESTIMATE])
            residuals.append(advance(node, *scan, dt_s, frozen))
        self.state[:] = node
        return residuals, before
