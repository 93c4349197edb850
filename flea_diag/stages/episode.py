"""One episode of the isolator: its hypotheses, its evidence, and how far it has got."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.fault_models import REGRESSORS
from flea_diag.core.isolation import Isolation
from flea_diag.core.likelihood import Evidence
from flea_diag.stages.inquiry import Inquiry

Array = npt.NDArray[np.float64]

ELAPSED, SPEED = REGRESSORS.index("elapsed_s"), REGRESSORS.index("speed_m_s")
MOTION_CHANNELS = ("actuator_position", "motor_speed")
MOTION = [REGRESSORS.index(name) for name in ("position_rate_m_s", "encoder_m_s")]
"""Channels that say that the actuator moves, and the speeds that they say."""
MOVING_M_S = 0.010
MOVED_SAMPLES = 50
"""So many scans in motion since the detection say that a channel still reads."""
CONCLUSIVE_SAMPLES = 50
"""Scans of evidence before likelihoods may drop anything."""
BOTH_WAYS_SAMPLES = 30
"""Scans in each direction of motion before parity residuals may decide by likelihood."""


@dataclass
class Episode:
    """State of one episode."""

    number: int
    start_ns: int
    isolation: Isolation
    likelihood: Evidence
    inquiry: Inquiry
    step: int = 0
    moving: int = 0
    symbols: tuple[tuple[str, str, str], ...] = ()
    weighed_at: int = 0
    settled: bool = False
    scans: int = 0
    out: int = 0
    back: int = 0
    moved: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, dtype=np.int64))

    def learn(self, stamp_ns: int, values: Array, regressors: Array) -> None:
        """One more scan of evidence; counts the scans in each direction of motion."""
        regressors[ELAPSED] = (stamp_ns - self.start_ns) / 1e9
        self.likelihood.add(values, regressors)
        self.scans += 1
        if np.isfinite(values[0]):
            self.out += bool(regressors[SPEED] > 0.0)
            self.back += bool(regressors[SPEED] < 0.0)
        self.moved += np.abs(regressors[MOTION]) > MOVING_M_S

    def conclusive(self) -> bool:
        """Whether likelihoods may drop: in one direction a drag and a bias look alike."""
        rubbing = any(residual.startswith("parity_mech") for residual, _, _ in self.symbols)
        if rubbing:
            return min(self.out, self.back) >= BOTH_WAYS_SAMPLES
        return self.scans >= CONCLUSIVE_SAMPLES

    def moved_channels(self) -> tuple[str, ...]:
        """Channels whose reading has moved since the detection."""
        pairs = zip(MOTION_CHANNELS, self.moved, strict=True)
        return tuple(channel for channel, samples in pairs if samples >= MOVED_SAMPLES)

    def magnitudes(self) -> dict[str, str]:
        """Magnitude symbol of every residual that has deviated."""
        return {residual: magnitude for residual, magnitude, _ in self.symbols}
