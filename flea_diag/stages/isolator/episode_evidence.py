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

"""Evidence of an episode from slow channels: residuals and motion since the detection.

At a standstill against a push the friction holds anything up to the dry friction, and goes on doing
so: few scans of such a standstill count in the balance that holds it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.goodness_of_fit import BLOCK_S
from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import DIRECTION
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.wire.blocks import ResidualBlock

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

STANDING_S = 0.3
"""Time at a standstill against a push that counts as one scan. An assumption: by far longer than a
scan, and short enough for a jam that mostly stands to be told from a bias."""
MOVED_S = 0.5
"""Time in motion since the detection after which a channel counts as alive."""


class EpisodeEvidence:
    """Normal equations of the scans since the detection, and counts of those in motion.

    Parameters
    ----------
    residuals : those that quantitative isolation uses
    acting : which signals faults act by in each of them, shape (residuals, signals)
    detected_ns : stamp of the detection
    onset_ns : time after it in which scans are left out (smoothing transient)
    parameters : of the actuator, by which it is in motion
    known : residuals of the stand
    counts : of scans at its rate
    """

    def __init__(
        self,
        residuals: Sequence[str],
        basis: Basis,
        acting: Flags,
        detected_ns: int,
        onset_ns: int,
        parameters: ActuatorParameters,
        known: ResidualSet,
        counts: ScanCounts,
    ) -> None:
        self._counts = counts
        self._in_motion = known.in_motion
        _, _, speed, position = known.followed
        self._speeds = {position: rate_symbol(position), speed: speed}
        """Channels of motion, and the signals that are their speeds."""
        self.equations = NormalEquations(residuals, basis, counts.of(BLOCK_S))
        self._basis, self._acting = basis, acting.T
        self._held = np.array([name == known.friction for name in residuals])
        self._stood, self._apart = 0, counts.of(STANDING_S)
        self._per_unit = np.array([1.0, parameters.encoder_m_per_rad])
        self._moving_m_s = parameters.moving_m_s
        self.scans = self.moving = 0
        self._detected_ns, self._onset_ns = detected_ns, onset_ns
        self._out = self._back = 0
        self._moved = np.zeros(len(self._speeds), dtype=np.int64)

    def add(self, block: ResidualBlock) -> None:
        """Add n scans, in order."""
        late = block.stamps_ns - self._detected_ns >= self._onset_ns
        if not late.any():
            return
        moving = block.regressors[late, -1] > 0.5
        values = np.full((len(moving), len(self.equations.residuals)), np.nan)
        for column, name in enumerate(self.equations.residuals):
            if name in block.names:
                values[:, column] = block.values[late, block.names.index(name)]
                if name in self._in_motion:
                    values[~moving, column] = np.nan
        places = self._basis.column
        regressors = block.regressors[late, : len(places)]
        regressors[:, places["elapsed_s"]] = (block.stamps_ns[late] - self._detected_ns) / 1e9
        speeds = regressors[:, [places[name] for name in self._speeds.values()]] * self._per_unit
        directions = regressors[np.isfinite(values[:, 0]), places[DIRECTION]]
        moved = np.abs(speeds) > self._moving_m_s
        # By either of two readings: which way its friction acts is known where both move.
        stands = moving & (np.abs(speeds) <= self._moving_m_s).any(axis=1)
        self._thin(values, stands)
        # Where a signal is missing, no fault that acts by it can be held against the residual.
        values[np.isnan(regressors) @ self._acting] = np.nan
        self.equations.add(values, regressors)
        self._count(moving, moved, directions)

    def _thin(self, values: Array, stands: Flags) -> None:
        """Keep one scan of the balance with the friction for so long a standstill."""
        number = self._stood + np.cumsum(stands)
        values[np.outer(stands & (number % self._apart != 0), self._held)] = np.nan
        self._stood = int(number[-1])

    def _count(self, moving: Flags, moved: Flags, directions: Array) -> None:
        """Count scans in motion, in each direction, and by each channel of motion."""
        self.scans += len(moving)
        self.moving += int(moving.sum())
        self._out += int((directions > 0.0).sum())
        self._back += int((directions < 0.0).sum())
        self._moved += moved.sum(axis=0)

    def lasts(self, time_s: float) -> bool:
        """Whether there are as many scans of evidence as in this time."""
        return self.scans >= self._counts.of(time_s)

    def moves(self, time_s: float) -> bool:
        """Whether as many were in motion."""
        return self.moving >= self._counts.of(time_s)

    @property
    def mostly_stands(self) -> bool:
        """Whether it stood against a push in most of them: then little can be weighed."""
        return 2 * self._stood > self.moving

    def goes_both_ways(self, time_s: float) -> bool:
        """Whether as many were in motion in each direction."""
        return min(self._out, self._back) >= self._counts.of(time_s)

    @property
    def motion(self) -> Array:
        """Scans in each direction of motion, and in motion by each channel of it, so far."""
        return np.array([self._out, self._back, *self._moved], dtype=float)

    def since(self, motion: Array) -> tuple[float, tuple[str, ...]]:
        """Time in the rarer direction since ``motion`` was that, and what has moved since."""
        out, back, *moved = self.motion - motion
        channels = zip(self._speeds, moved, strict=True)
        least = self._counts.of(MOVED_S)
        seconds = min(out, back) * self._counts.period_s
        return seconds, tuple(channel for channel, samples in channels if samples >= least)

    def moved_channels(self) -> tuple[str, ...]:
        """Channels whose reading has moved since the detection."""
        pairs = zip(self._speeds, self._moved, strict=True)
        return tuple(channel for channel, samples in pairs if samples >= self._counts.of(MOVED_S))
