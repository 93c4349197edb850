"""One episode of the isolator: its hypotheses, its evidence, and how far it has got."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.likelihood.fault_models import REGRESSORS
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.stages.isolator.feature_query import Inquiry
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import EARLIER_LEVEL, TAKEN_OVER, Detection

Array = npt.NDArray[np.float64]

ELAPSED, DIRECTION = REGRESSORS.index("elapsed_s"), REGRESSORS.index("direction")
MOTION_CHANNELS = ("actuator_position", "motor_speed")
MOTION = [REGRESSORS.index(name) for name in ("position_rate_m_s", "encoder_m_s")]
"""Channels that say that the actuator moves, and the speeds that they say."""
MOTION_ONLY = ("parity_mechanical",)
CIRCUIT = "parity_electrical"
MOVING_M_S = 0.010
MOVED_SAMPLES = 50
"""So many scans in motion since the detection say that a channel still reads."""
CONCLUSIVE_SAMPLES = 50
"""Scans of evidence before likelihoods, or a symptom that stays out, may drop anything."""
BOTH_WAYS_SAMPLES = 30
"""Scans in each direction of motion before parity residuals may decide by likelihood."""


@dataclass
class Episode:
    """State of one episode."""

    number: int
    start_ns: int
    isolation: Isolation
    likelihood: NormalEquations
    inquiry: Inquiry
    opened_by: str = ""
    shifted: str = ""
    """The residual that opened it by leaving its own level of this run: before, all was well."""
    heard: bool = False
    """Whether vibration opened it: what shows that may have come with another unit."""
    taken_over: bool = False
    """Whether the observer came back within it: then only a reset ends it."""
    step: int = 0
    moving: int = 0
    symbols: tuple[tuple[str, str, str], ...] = ()
    weighed_at: int = 0
    settled: bool = False
    scans: int = 0
    out: int = 0
    back: int = 0
    moved: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, dtype=np.int64))

    def group(self) -> dict[str, float]:
        """Faults still possible, each with its probability."""
        return {h.name: h.probability for h in self.isolation.alive()}

    @property
    def gives_way(self) -> bool:
        """Whether only the circuit has left its own level: to what is then heard in vibration.

        Another unit, whose winding is another, may have come with a fault of its screw.
        """
        deviating = (self.shifted, *(residual for residual, _, _ in self.symbols))
        return not self.heard and all(map(is_circuit, deviating))

    @property
    def is_silent(self) -> bool:
        """Whether vibration alone shows something, no relation: that there is no drag says much."""
        return self.heard and not self.symbols and not self.shifted

    def is_of_unit(self, residual: str) -> bool:
        """Whether this has left its own level of this run alone, and vibration has the word."""
        return self.heard and relation(residual) == relation(self.shifted)

    def learn(self, block: ResidualBlock, onset_ns: int) -> None:
        """NormalEquations of more scans, but for those that still show the onset."""
        late = block.stamps_ns - self.start_ns >= onset_ns
        if not late.any():
            return
        moving = block.regressors[late, -1] > 0.5
        values = np.full((len(moving), len(self.likelihood.residuals)), np.nan)
        for column, name in enumerate(self.likelihood.residuals):
            if name in block.names:
                values[:, column] = block.values[late, block.names.index(name)]
                if name in MOTION_ONLY:
                    values[~moving, column] = np.nan
        regressors = block.regressors[late, : len(REGRESSORS)]
        regressors[:, ELAPSED] = (block.stamps_ns[late] - self.start_ns) / 1e9
        self.likelihood.add(values, regressors)
        self._count(moving, regressors[:, MOTION], regressors[np.isfinite(values[:, 0]), DIRECTION])

    def _count(self, moving: npt.NDArray[np.bool_], speeds: Array, told: Array) -> None:
        """Scans in motion, in each direction of it, and of each channel that says so."""
        self.scans += len(moving)
        self.moving += int(moving.sum())
        self.out += int((told > 0.0).sum())
        self.back += int((told < 0.0).sum())
        self.moved += (np.abs(speeds) > MOVING_M_S).sum(axis=0)

    def conclusive(self) -> bool:
        """Whether likelihoods may drop: in one direction a drag and a bias look alike.

        Unless the circuit deviates as well, which no drag makes it do.
        """
        seen = self.magnitudes()
        if any(residual.startswith("parity_mech") for residual in seen) and CIRCUIT not in seen:
            return min(self.out, self.back) >= BOTH_WAYS_SAMPLES
        return self.scans >= CONCLUSIVE_SAMPLES

    def moved_channels(self) -> tuple[str, ...]:
        """Channels whose reading has moved since the detection."""
        pairs = zip(MOTION_CHANNELS, self.moved, strict=True)
        return tuple(channel for channel, samples in pairs if samples >= MOVED_SAMPLES)

    def magnitudes(self) -> dict[str, str]:
        """Magnitude symbol of every residual that has deviated."""
        return {residual: magnitude for residual, magnitude, _ in self.symbols}


def relation(residual: str) -> str:
    """The residual itself, of which one normalised by the direction of motion is another view."""
    return residual.removesuffix("_dn")


def is_circuit(residual: str) -> bool:
    """Whether this is a relation of the winding."""
    return relation(residual) == CIRCUIT


def shifted(detection: Detection) -> str:
    """The residual that left its own level of this run, and no limit; empty where none did."""
    return detection.residual if detection.test.endswith(EARLIER_LEVEL) else ""


def cause(detection: Detection) -> str:
    """What opened an episode: the test that passed its limit, with value and limit."""
    if detection.test == TAKEN_OVER:
        return "open when the observer came back"
    return (
        f"{detection.residual}: z = {detection.z:.4g}, limit {detection.threshold:.4g}, "
        f"{detection.test}"
    )
