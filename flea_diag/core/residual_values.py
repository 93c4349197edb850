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

"""Values of the residuals of one stand: a table of all of them in some scans.

``residual_bank`` computes those of parity relations and predictions, ``sensor_tests`` those of
single sensors, ``state_observer`` the innovations.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(slots=True)
class ResidualRows:
    """All residuals of n scans; NaN where one cannot be computed.

    Not frozen: cross-checks of channels drop unusable values.

    ``values`` has shape (n, residuals), order of ``ResidualSet.rows``, and ``spread`` (n,
    ``ResidualSet.spreading``, unit parameters): d r / d theta of healthy units. ``signals``, shape
    (n, signals), are those of the relations, in their order, smoothed, NaN where a channel is
    absent or bad. ``motion``, shape (n, 2), is the speed at the nut, m/s, and the smooth sign of
    the motion, or of the push where the actuator is stalled. ``moving``, (n,), includes a
    standstill under a force that moves any healthy unit. ``modes``, shape (n, modes), are the
    states of ``ResidualSet.modes``. ``noise``, shape (n, residuals), is how much noisier each value
    is for readings that are missing; None: they are all there. ``doubt``, of the same shape, is the
    variance by what is not known of this run, in times what was calibrated; None: as calibrated.
    ``moved``, of the same shape, is by how much each is another since a value of this run was made
    more exact; None: by nothing.
    """

    values: Array
    spread: Array
    signals: Array
    motion: Array
    moving: Flags
    modes: npt.NDArray[np.int8] = field(default_factory=lambda: np.empty((0, 0), dtype=np.int8))
    noise: Array | None = None
    doubt: Array | None = None
    moved: Array | None = None

    def __len__(self) -> int:
        return len(self.values)

    @property
    def speed_m_s(self) -> Array:
        """Speed at the nut, shape (n,)."""
        return self.motion[:, 0]

    def leave_out(self, scans: Flags, columns: list[int]) -> None:
        """Drop these residuals in these scans."""
        for column in columns:
            self.values[scans, column] = np.nan

    def begin_anew(self, scans: Flags, columns: list[int]) -> None:
        """End the means of residuals in these scans, shape (n, columns): no variance is known."""
        if scans.any():
            doubt = np.ones_like(self.values) if self.doubt is None else self.doubt
            doubt[:, columns] = np.where(scans, np.nan, doubt[:, columns])
            self.doubt = doubt
