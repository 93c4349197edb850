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

"""Two-sided robust Z-tests on windowed residual means, thresholds from nominal recordings.

For residual j and window w the statistic is the mean m of its last w valid samples, and

    z = (m - centre) / sqrt(sigma_w^2 + sum_p (tolerance_p * mean dr/dp)^2),   |z| > k_w  ->  symbol

sigma_w is the rms of that mean over nominal recordings (in the speed region of the window),
so coloured model error is in it: the "robust" E of the Z-test. The sum is what another
healthy unit of the same design may differ by. k_w is the Student quantile that gives the
stated false-alarm rate. (Z-test: Mosterman and Biswas 1999; Narasimhan et al. 2010, 3.1.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.detection.mean_shift_loops import ShiftInput
from flea_diag.core.detection.residual_test_loops import RESIDUAL_TEST_LOOPS
from flea_diag.core.detection.symbols import MIXED, Test
from flea_diag.core.detection.window_limit import ResidualLimit
from flea_diag.core.detection.z_test import ZTests
from flea_diag.core.detection.z_test_loops import Z_TEST_LOOPS
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


Lasting = Sequence[int] | npt.NDArray[np.int64]


class TestResults:
    """For each residual and scan the test nearest to its limit, shape (n, residuals).

    ``z``: statistic, and ``k``: its limit, NaN where nothing was tested. ``window``: samples of
    the mean, 0 where there is none. ``growth``: factor by which the limit of that mean has grown.
    ``table``, shape (4, n, residuals), holds the four, ``every`` them and the next:
    ``shift``: mean minus the earlier level of this run, in the unit of the residual; NaN for a
    test against the calibration. ``void``: whether a condition keeps residuals from being tested,
    which is no quiet. ``along``: column -> reading whose coefficient has shifted, and in which of
    the n scans. ``shifted``: whether a shift of a mean is beyond its limit, where that was looked
    at together with the Z-tests.
    ``way``, n of each: direction of motion and for how many scans in motion it has lasted,
    both 0 at a standstill against a push; it matters to the columns ``directed``.
    """

    __slots__ = (
        "along", "directed", "every", "growth", "k", "shift", "shifted", "void", "way", "window",
        "z",
    )  # fmt: skip

    def __init__(self, residuals: int, scans: int = 1, filled: bool = True) -> None:
        every = self.every = np.empty((5, scans, residuals))
        self.void = self.shifted = False
        self.along: dict[int, tuple[str, Flags]] = {}
        self.z, self.k, self.window, self.growth, self.shift = every
        if filled:  # else somebody else does
            every.fill(np.nan)
            self.window.fill(0.0)
            self.growth.fill(1.0)
        self.way: tuple[Lasting, Lasting] = (0,) * scans, (0,) * scans
        self.directed = frozenset[int]()

    @property
    def table(self) -> Array:
        """Statistic, limit, window and growth."""
        return self.every[:4]

    def direction(self, index: int) -> Array:
        """Direction of motion in the window of a residual after each scan; see ``Test``."""
        way, lasted = np.array(self.way, dtype=float)
        if index not in self.directed:
            return np.zeros_like(way)
        whole = (way != 0.0) & (lasted >= self.window[:, index])
        return np.where(whole, way, MIXED)

    def deviating(self) -> npt.NDArray[np.bool_]:
        """Which residuals exceed their limits; an untested one does not."""
        beyond: npt.NDArray[np.bool_] = np.abs(self.z) > self.k
        return beyond

    @property
    def quiet(self) -> bool:
        """Whether none does in any scan."""
        return not np.count_nonzero(self.deviating())

    def signed(self, index: int) -> Flags | bool:
        """In which scans, shape (n,), a deviation has a sign: no coefficient has shifted."""
        return ~self.along[index][1] if index in self.along else True

    def test(self, index: int) -> tuple[float, Test]:
        """Statistic after the first scan, and the test that it belongs to.

        In sigmas of what was calibrated: a limit that grows makes no deviation smaller. A shift
        is tested by limits that do not.
        """
        z, k, window, growth = self.table[:, 0, index].tolist()
        if math.isnan(self.shift[0, index]):
            z *= growth
        return z, (window, k, float(self.direction(index)[0]))

    def symbol(self, index: int) -> str:
        """+, - or 0, after the last scan."""
        z, k = self.z[-1, index], self.k[-1, index]
        return "0" if not abs(z) > k else "+" if z > 0 else "-"


class Detector:
    """Runs every test of a residual set on a stream of residuals, constant memory.

    Numpy and numba, which ``backend`` chooses between, give the same bits.
    """

    def __init__(
        self,
        known: ResidualSet,
        limits: Sequence[ResidualLimit],
        tolerance: Sequence[float],
        thermal_rate_k_per_s: float,
        backend: str = "auto",
        *,
        counts: ScanCounts,
    ) -> None:
        extra = (thermal_rate_k_per_s * CORRECTION_S) ** 2
        named = {limit.name: limit for limit in limits}
        self._compiled = backends.chosen(backend) == "numba"
        self._count = len(known.rows)
        self._one = np.ones((1, self._count))
        self._groups = tuple(
            ZTests(known, gate, named, np.array(tolerance), extra, counts)
            for gate in ("moving", "always")
        )

    def step(
        self, rows: ResidualRows, growth: Array | None = None, shift: ShiftInput | None = None
    ) -> TestResults:
        """Results after each of these rows.

        ``growth``, shape (n, residuals): variance of each residual there, in times what was
        calibrated; None: as calibrated. ``shift``: see ``MeanShiftTest.input``.
        """
        results = TestResults(self._count, len(rows), not self._compiled)
        grown = self._one if growth is None else growth
        if self._compiled:
            moving, still = self._groups
            groups = moving.group(), still.group()
            told = (rows.values, grown, rows.motion, rows.spread), rows.moving, groups
            if shift is None:
                backends.exact(*Z_TEST_LOOPS)(*told, results.every)
            else:
                results.shifted = backends.exact(*RESIDUAL_TEST_LOOPS)(*told, results.every, shift)
            return results
        grown = np.broadcast_to(grown, rows.values.shape)
        for group in self._groups:
            group.step(rows, grown, results.table)
        return results

    def adopt(self, change: Sequence[float], tolerance: Sequence[float]) -> None:
        """Use unit parameters changed by ``change``, with standard deviations ``tolerance``.

        Residuals in the windows are corrected by r + (dr/dp) dp, so that no sample is lost.
        """
        for group in self._groups:
            group.adopt(np.array(change), np.array(tolerance))

    def forget(self, columns: Sequence[int]) -> None:
        """Empty the windows of some residuals, whose channel turned out to be bad."""
        for group in self._groups:
            group.forget(columns)

    def clear(self) -> None:
        """Empty every window (re-arming)."""
        self.forget(range(self._count))
