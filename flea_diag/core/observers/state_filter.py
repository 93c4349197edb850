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

"""What every state filter of the observer is: a model, ``predict``, ``update``, consistency.

A filter tracks the states of a model whose measurement is linear, y = H x + D u + h + noise,
and whose noise is Gaussian; the transition may be anything. A filter that has
lost its track says so (``ConsistencyMonitor``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class FilterModel(Protocol):
    """What a filter runs on: n states, p channels, m inputs; N particles are columns."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured channels."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def driving(self) -> npt.NDArray[np.bool_]:
        """Channels that stand for inputs, shape (p,): they count even when frozen."""
        ...

    @property
    def H(self) -> Array:
        """Measurement matrix, shape (p, n)."""
        ...

    @property
    def D(self) -> Array:
        """What inputs add to the measurement, shape (p, m)."""
        ...

    @property
    def h(self) -> Array:
        """Offsets of the measurement, shape (p,)."""
        ...

    @property
    def R(self) -> Array:
        """Covariance of the measurement noise, shape (p, p)."""
        ...

    @property
    def linear(self) -> tuple[Array, Array] | None:
        """A (n, n) and B (n, m) of a linear transition, which a filter may then do itself."""
        ...

    def transition(self, x: Array, u: Array) -> Array:
        """States one period later without noise, (n, N) and (m,) -> (n, N), ``x`` kept."""
        ...

    def linearised(self, x: Array, u: Array) -> tuple[Array, Array]:
        """The transition of one state, and its partial derivatives: (n,) -> (n,), (n, n)."""
        ...

    def process_noise(self, u: Array) -> Array:
        """Covariance of what one period adds under ``u``, shape (n, n).

        One of a few arrays that the model keeps, so that filters can keep what they derive.
        """
        ...


class Innovation:
    """Measurement against prediction in one scan: views of one row of numbers."""

    __slots__ = ("_p", "diverged", "measured", "row")

    def __init__(self, row: Array, channels: int, measured: int, diverged: bool) -> None:
        self.row = row
        self._p = channels
        self.measured = measured
        """How many channels were measured."""
        self.diverged = diverged
        """The filter has lost its track; see ``ConsistencyMonitor``."""

    @property
    def prediction(self) -> Array:
        """Estimate of every channel from all earlier scans, measured now or not, (p,)."""
        return self.row[: self._p]

    @property
    def residual(self) -> Array:
        """Measured less prediction, (p,); NaN where nothing was measured."""
        return self.row[self._p : 2 * self._p]

    @property
    def sigma(self) -> Array:
        """Standard deviation expected of each residual, (p,); 0 where nothing was measured."""
        return self.row[2 * self._p : 3 * self._p]

    @property
    def mean(self) -> Array:
        """Estimated states after the correction, (n,)."""
        return self.row[3 * self._p : -2]

    @property
    def nis(self) -> float:
        """Normalised innovation squared; its mean is ``measured`` while all is well."""
        return float(self.row[-2])

    @property
    def ess(self) -> float:
        """Effective sample size before resampling; inf for a filter without particles."""
        return float(self.row[-1])


class Filter(Protocol):
    """One interface for particle and Kalman filters."""

    @property
    def backend(self) -> str:
        """What computes: "numpy" or "numba"."""
        ...

    @property
    def mean(self) -> Array:
        """Estimated states, shape (n,)."""
        ...

    @property
    def covariance(self) -> Array:
        """Their covariance, shape (n, n)."""
        ...

    def predict(self, u: Array) -> None:
        """Advance by one period under the inputs ``u``, shape (m,)."""
        ...

    def update(self, y: Array, *, frozen: bool = False) -> Innovation:
        """Compare with a measurement, shape (p,), NaN = not measured, and correct by it.

        ``frozen`` compares only: after a detection nothing is corrected, so that a faulty
        sensor does not smear into the states.
        """
        ...

    def adopt(self, model: FilterModel) -> None:
        """Go on with another model of the same states and channels (offsets learned)."""
        ...


LOST = 10.0
"""Mean of NIS over channels measured at which a filter counts as diverged; 1 is expected."""
UNIT_SIGMAS = 3.0
"""Of a normal distribution 0.3 % lie beyond."""
MEMORY = 50
"""Scans over which that mean reaches back."""


class ConsistencyMonitor:
    """Consistency of a filter by its normalised innovation squared, NIS.

    See Bar-Shalom et al. 2001, section 5.4.

    An exponential mean of NIS / channels, which is 1 for a filter that knows its own error.
    Model and reality always differ somewhat: ``LOST`` is lost, or, where more is ``expected`` of
    healthy units, what one of them shows at three sigmas of their differences.
    """

    def __init__(self, memory: int = MEMORY, expected: float = 1.0) -> None:
        self._share = 1.0 / memory
        self._lost = max(LOST, UNIT_SIGMAS**2 * expected)
        self.level = 1.0

    @property
    def limits(self) -> tuple[float, float]:
        """Share of the last scan in the mean, and the mean at which the track is lost."""
        return self._share, self._lost

    def step(self, nis: float, measured: int) -> bool:
        """Take one scan; whether the filter has diverged."""
        return self.follow((nis,), (measured,))[0]

    def follow(self, nis: Sequence[float], measured: Sequence[int]) -> list[bool]:
        """Take scans in order; whether the filter has diverged, after each."""
        level, share, lost = self.level, self._share, self._lost
        # One outlier, of any size, is not yet a lost track.
        most = 10.0 * lost
        found = []
        for squared, count in zip(nis, measured, strict=True):
            if count:
                each = squared / count
                level += share * ((each if each < most else most) - level)  # NaN is no less lost
            found.append(level > lost)
        self.level = level
        return found
