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

"""What friction does to a stream beyond the noise of its law.

It varies along the stroke, so a window that passes little of it says little that the one before has
not said. Pushed at a standstill it holds anything up to the dry friction, and goes on doing so.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.run_law.run_windows import signal_names, speed_signal

Array = npt.NDArray[np.float64]

SLOWEST = 0.05
"""Share of the usual speed below which a window counts as one at this speed."""


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of one stand.

    Attributes
    ----------
    dry
        What the dry friction holds of each signal, shape (relations, signals).
    speed
        Place of the speed among the signals.
    usual_speed
        Its median in healthy motion; 0: not known.
    """

    dry: Array
    speed: int
    usual_speed: float

    @classmethod
    def of(cls, dry: Array, effects: EffectSet, usual_speed: float) -> Friction:
        """Of the stand of these effects."""
        speed = signal_names(effects).index(speed_signal(effects.residuals))
        return cls(dry, speed, usual_speed)

    def held(self, window: LawWindow) -> Array:
        """What the relations have taken off for it at a standstill against a push.

        Shape (..., relations).
        """
        stands = np.asarray(window.stands)[..., None]
        return np.asarray((window.signals * self.dry).sum(axis=-1) * stands)

    def loudness(self, signals: Array) -> Array:
        """Factor of the standard deviation for the stroke of a window, shape (..., relations).

        ``signals`` as they are read, shape (..., relations, signals).
        """
        if not self.usual_speed:
            return np.ones(signals.shape[:-1])
        speed = np.abs(signals[..., self.speed]).max(axis=-1)
        share = self.usual_speed / np.maximum(speed, SLOWEST * self.usual_speed)
        factor = np.sqrt(np.maximum(share, 1.0))[..., None]
        return np.where(self._rubs, factor, 1.0)

    def way(self, window: LawWindow) -> Array:
        """Direction of motion: 1 forth, -1 back, 0 about a standstill, shape (...)."""
        speed = np.median(window.read[..., self.speed], axis=-1)
        return np.where(np.abs(speed) > SLOWEST * self.usual_speed, np.sign(speed), 0.0)

    @cached_property
    def _rubs(self) -> npt.NDArray[np.bool_]:
        """Relations that hold dry friction, shape (relations,)."""
        return np.asarray((self.dry != 0.0).any(axis=1))
