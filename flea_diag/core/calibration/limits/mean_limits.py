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

"""Tests of windowed means against the calibration, fitted to nominal recordings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.limits.limit_samples import SHIFT_SHARE, LimitSamples, spread_of
from flea_diag.core.calibration.limits.window_fit import WindowFit, WindowStatistic, window_fit
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S
from flea_diag.core.residuals.residual_rows import ResidualRow
from flea_diag.core.running_mean import rolling_means
from flea_diag.core.sensors.sensor_limits import SENSOR_SHARE

Array = npt.NDArray[np.float64]

REGIONS = len(SPEED_REGIONS_M_S) + 1


def mean_tests(given: LimitSamples) -> tuple[tuple[WindowFit, ...], dict[str, float]]:
    """Tests against the calibration; the scatter of single samples of each residual tested."""
    tests = sum(row.gate != "sensor" for row in given.rows.rows)
    rate = (1.0 - SENSOR_SHARE - SHIFT_SHARE) * given.rate_per_hour / tests
    found, scatter = [], {}
    for index, row in enumerate(given.rows.rows):
        if row.gate == "sensor":
            continue
        columns = [_gated(row, index, entry) for entry in given.traces]
        everything = np.concatenate([values for values, _, _ in columns] or [np.empty(0)])
        if not np.any(everything):
            continue
        for window in map(given.counts.of, row.windows_s):
            k = given.student(rate, window, len(everything))
            means = [
                _means(column, window, given.differing, given.extra(row)) for column in columns
            ]
            fit = window_fit(row.name, window, means, REGIONS, k, given.others)
            if fit is not None:
                found.append(fit)
                scatter[row.name] = float(everything.std())
    return tuple(found), scatter


def _gated(row: ResidualRow, index: int, entry: Trace) -> tuple[Array, Array, Array]:
    """Values of a residual where it is tested, the speed, and what units differ by there."""
    values = entry.values[:, index]
    use = np.isfinite(values)
    if row.gate == "moving":
        use &= entry.moving
    return values[use], np.nan_to_num(entry.speed_m_s[use]), spread_of(entry, index)[use]


def _means(
    column: tuple[Array, Array, Array], window: int, differing: Array, extra: float
) -> WindowStatistic:
    """Windowed means of one recording, the region of the mean speed, what units differ by."""
    values, speed, spread = column
    if len(values) < window:
        return WindowStatistic(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0))
    region = np.searchsorted(SPEED_REGIONS_M_S, rolling_means(speed, window))
    unit = np.square(rolling_means(spread, window) * differing).sum(axis=1)
    return WindowStatistic(
        rolling_means(values, window), np.asarray(region, dtype=np.int64), unit + extra
    )
