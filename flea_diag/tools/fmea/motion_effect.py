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

"""What a failure does to the motion: the true signals of the simulation, after the onset."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_sim_driver.acquisition.acquisition import Block

Array = npt.NDArray[np.float64]

ALIKE = 0.01
"""Share of a tracking error or a current that is no effect."""


@dataclass(frozen=True)
class MotionEffect:
    """Tracking error in m of the nut (rad of a machine that turns), current, and temperature."""

    tracking_rms: float
    tracking_peak: float
    current_rms_a: float
    winding_degc: float

    def like(self, other: MotionEffect | None) -> bool:
        """Whether tracking error and current are those of another run, within ``ALIKE``."""
        if other is None:
            return False
        pairs = (
            (self.tracking_rms, other.tracking_rms),
            (self.current_rms_a, other.current_rms_a),
        )
        return all(abs(mine - its) <= ALIKE * its for mine, its in pairs)


@dataclass
class MotionRecord:
    """Collects one run; ``from_s`` is the time from which on it counts."""

    from_s: float
    errors: list[Array] = field(default_factory=list)
    currents: list[Array] = field(default_factory=list)
    winding_degc: float = float("nan")

    def add(self, block: Block, winding_degc: float) -> None:
        """Take the true signals of the next block."""
        self.winding_degc = winding_degc
        if block.begin_s >= self.from_s - 1e-9:
            self.errors.append(block.position - block.column("load_position"))
            self.currents.append(block.column("current"))

    @property
    def effect(self) -> MotionEffect:
        """Of the whole run so far."""
        errors, currents = np.concatenate(self.errors), np.concatenate(self.currents)
        return MotionEffect(
            float(np.sqrt(np.mean(errors**2))),
            float(np.max(np.abs(errors))),
            float(np.sqrt(np.mean(currents**2))),
            self.winding_degc,
        )
