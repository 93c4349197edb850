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

"""Tests of a shift within a recording, of a mean or of a coefficient, fitted to nominal ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.limits.limit_samples import SHIFT_SHARE, LimitSamples, spread_of
from flea_diag.core.calibration.limits.window_fit import WindowFit, WindowStatistic, window_fit
from flea_diag.core.calibration.nominal_trace import Trace, coefficient_shifts, own_noise
from flea_diag.core.detection.coefficient_shift import COEFFICIENT_WINDOWS_S
from flea_diag.core.detection.mean_shift import SHIFT_WINDOWS_S, MeanShift
from flea_diag.core.residuals.residual_rows import ResidualRow

Array = npt.NDArray[np.float64]


def shift_tests(given: LimitSamples, between: Mapping[str, float]) -> tuple[WindowFit, ...]:
    """Tests of the shift within a recording; they share ``SHIFT_SHARE`` of the rate."""
    spreading, terms = given.rows.spreading, given.terms
    tests = len(spreading) * len(SHIFT_WINDOWS_S) + len(terms) * len(COEFFICIENT_WINDOWS_S)
    rate = SHIFT_SHARE * given.rate_per_hour / max(tests, 1)
    samples = sum(len(entry.values) for entry in given.traces)
    found = []
    for column in spreading:
        row = given.rows.rows[column]
        shifts, own = (
            [_shifts(row, column, entry, given) for entry in part]
            for part in (given.traces, given.judged)
        )
        for index, window in enumerate(map(given.counts.of, SHIFT_WINDOWS_S)):
            k = given.student(rate, window, samples)
            every, judged = ([_known(each[:, index]) for each in part] for part in (shifts, own))
            fit = window_fit(row.name, window, every, 1, k, given.others, False, judged)
            found += [fit] if fit is not None else []
    for name in dict.fromkeys(term.residual for term in terms):
        least_k = partial(given.student, rate, samples=samples)
        found += _coefficient_tests(name, given, between.get(name, 0.0), least_k)
    return tuple(found)


def _coefficient_tests(
    name: str, given: LimitSamples, between: float, least_k: Callable[[int], float]
) -> Iterator[WindowFit]:
    """Tests of the coefficients of one residual on its readings."""
    terms = [term for term in given.terms if term.residual == name]
    tolerance = given.differing_of(terms[0].units)
    sigma = own_noise(given.traces, terms[0], tolerance, between)
    if not sigma > 0.0:
        return
    shifts, own = (
        [
            coefficient_shifts(entry, terms, tolerance, between, sigma, given.counts)
            for entry in part
        ]
        for part in (given.traces, given.judged)
    )
    for index, window in enumerate(map(given.counts.of, COEFFICIENT_WINDOWS_S)):
        for place, term in enumerate(terms):
            every, judged = (
                [_known(each[:, place, index, None]) for each in part] for part in (shifts, own)
            )
            k = least_k(window)
            fit = window_fit(name, window, every, 1, k, given.others, False, judged)
            if fit is not None:
                yield replace(fit, along=term.channel, noise=sigma)


def _known(shifts: Array) -> WindowStatistic:
    """Shifts, shape (n, 1 + unit parameters), where there are any."""
    known = shifts[np.isfinite(shifts[:, 0])]
    region = np.zeros(len(known), dtype=np.int64)
    return WindowStatistic(known[:, 0], region, np.square(known[:, 1:]).sum(axis=1))


def _shifts(row: ResidualRow, column: int, entry: Trace, given: LimitSamples) -> Array:
    """Shifts of a residual and of what units differ by, (scans, windows, 1 + unit parameters)."""
    gated = row.gate == "moving"
    use = entry.moving[:, None] | (not gated)
    spread = spread_of(entry, column) * given.differing
    values = np.concatenate((entry.values[:, [column]], spread), axis=1)
    level = MeanShift([gated], values.shape[1], counts=given.counts)
    return level.step(values[:, None], use)[:, 0]
