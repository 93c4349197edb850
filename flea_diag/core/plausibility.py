"""Whether a voltage channel is to be trusted, where no second source corroborates it.

A voltage that disagrees with current and motion by more than any healthy unit or winding
fault could explain is a bad channel. It is judged on the smoothed electrical residual:
implausible samples are left out at once, ``ENTER_SAMPLES`` of them in a row make a bad stretch, and
the channel is trusted again only after ``CLEAN_SAMPLES`` plausible ones.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

ENTER_SAMPLES = 20
CLEAN_SAMPLES = 1000


class VoltagePlausibility:
    """Streams the electrical residual (V) of one recording."""

    def __init__(self, limit_v: float) -> None:
        self._limit_v = limit_v
        self._implausible = 0
        self._clean = CLEAN_SAMPLES
        self.bad = False

    def step(self, residual_v: float) -> bool:
        """Whether this sample may be used."""
        if math.isnan(residual_v):
            return not self.bad
        if abs(residual_v) > self._limit_v:
            self._implausible += 1
            self._clean = 0
            self.bad = self.bad or self._implausible >= ENTER_SAMPLES
            return False
        self._implausible = 0
        self._clean += 1
        if self.bad and self._clean >= CLEAN_SAMPLES:
            self.bad = False
        return not self.bad


def usable(residual_v: npt.NDArray[np.float64], limit_v: float) -> npt.NDArray[np.bool_]:
    """Which samples of a whole recording may be used, shape as given."""
    check = VoltagePlausibility(limit_v)
    return np.array([check.step(float(value)) for value in residual_v], dtype=bool)
