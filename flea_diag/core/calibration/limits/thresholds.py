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

"""Limits of every residual from nominal recordings, for a stated false-alarm rate.

The scatter of a windowed mean is measured on the recordings, so it includes the coloured model
error and the differences between runs. The limit k is the Student quantile for the share of the
false-alarm rate allotted to one test of one window. Its degrees of freedom are the number of
ten-second pieces of nominal recording. It is never below ``GUARD`` times the largest nominal value,
each recording judged without itself (``window_fit``).

The windows of one residual and the scans of one recording are far from independent. So one number
of each recording, the largest statistic of a residual over the limit learned from the others, says
how near it came to a false alarm. Where the tail of these numbers (``extreme_value``) reaches
beyond 1 at the stated rate, the limits of that residual are widened by as much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.limits.extreme_value import return_level
from flea_diag.core.calibration.limits.limit_samples import LimitSamples
from flea_diag.core.calibration.limits.mean_limits import REGIONS, mean_tests
from flea_diag.core.calibration.limits.shift_limits import shift_tests
from flea_diag.core.calibration.limits.window_fit import WindowFit, others_of
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.calibration.out_of_sample import OutOfSample
from flea_diag.core.calibration.promise import LEAST_RECORDINGS
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit
from flea_diag.core.residuals.parameters import UnitTolerance
from flea_diag.core.residuals.residual_rows import ReadingTerm
from flea_diag.core.sensors.sensor_limits import SENSOR_SHARE

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

NOT_NOMINAL = 1.7
"""Score of a recording beyond which it is not taken for nominal. The 29 nominal recordings of the
FLEA reach 0.87, six of its jams, each among them, 2.2 to 3.8."""


@dataclass(frozen=True)
class LimitFit:
    """Every test on the nominal recordings, and how near each recording came to a false alarm.

    ``scores``, shape (recordings,): the largest statistic over its limit, by limits learned without
    that recording; ``worst``: the test that it belongs to. ``scatter``: of single samples.
    ``spread``: d r / d theta of healthy units where the residual does not tell it.
    """

    tests: tuple[WindowFit, ...]
    shifts: tuple[WindowFit, ...]
    scatter: Mapping[str, float]
    spread: Mapping[str, tuple[float, ...]]
    scores: Array
    worst: tuple[str, ...]
    rate_per_hour: float

    def out_of_sample(self) -> OutOfSample | None:
        """Summary of the scores; None where no recording can be judged by the others."""
        known = self.scores[np.isfinite(self.scores)]
        if not len(known):
            return None
        alarms = int((known >= 1.0).sum())
        widest = max(fit.widening for fit in (*self.tests, *self.shifts))
        return OutOfSample(len(known), alarms, float(known.max()), widest)

    def limits(self) -> tuple[ResidualLimit, ...]:
        """Limits of every residual that the recordings can form."""
        return tuple(self._limit(name, scatter) for name, scatter in self.scatter.items())

    def _limit(self, name: str, scatter: float) -> ResidualLimit:
        windows = [
            WindowLimit(fit.window, fit.centre, fit.sigma, fit.k)
            for fit in self.tests
            if fit.name == name
        ]
        correlation = _correlation(windows, scatter)
        spread = self.spread.get(name, ())
        return ResidualLimit(name, tuple(windows), (scatter,) * REGIONS, correlation, spread)

    def shift_limits(self) -> tuple[MeanShiftLimit, ...]:
        """Limits of the mean shift within a recording, for residuals with unit variability."""
        return tuple(
            MeanShiftLimit(fit.name, fit.window, *fit.shift_limit, fit.along) for fit in self.shifts
        )


def fit_limits(
    traces: Sequence[Trace],
    false_alarms_per_hour: float,
    period_s: float,
    tolerance: UnitTolerance,
    folds: Sequence[str] = (),
    spread: Mapping[str, tuple[float, ...]] = MappingProxyType({}),
    judged: Sequence[Trace] = (),
    terms: Sequence[ReadingTerm] = (),
) -> LimitFit:
    """Fit every test to nominal recordings.

    Parameters
    ----------
    tolerance
        What healthy units differ by.
    folds
        Of each recording what is left out together with it: its name, or its unit.
    spread
        d r / d theta of healthy units for residuals without an analytical one.
    judged
        The recordings again, each by parameters fitted without it. What parameters may be off by
        is in the spread of units, so the scatter is that of the whole fit.
    terms
        Readings whose coefficients are tested besides.
    """
    if not traces:
        return LimitFit((), (), {}, {}, np.empty(0), (), false_alarms_per_hour)
    others = others_of(folds or tuple(map(str, range(len(traces)))))
    given = LimitSamples(
        traces, judged or traces, others, tolerance, false_alarms_per_hour, period_s, spread, terms
    )
    tests, scatter = mean_tests(given)
    between = {fit.name: 0.0 for fit in tests}
    for fit in tests:
        between[fit.name] = max(between[fit.name], max(fit.sigma) ** 2)
    shifts = shift_tests(given, between)
    scores, worst = _scores((*tests, *shifts), others)
    tests, shifts = (_widened(fits, given) for fits in (tests, shifts))
    return LimitFit(tests, shifts, scatter, spread, scores, worst, false_alarms_per_hour)


def _widened(fits: tuple[WindowFit, ...], given: LimitSamples) -> tuple[WindowFit, ...]:
    """The fits with the widening that the tail of the scores of each residual asks for."""
    hours = sum(len(entry.values) for entry in given.traces) * given.period_s / 3600.0
    share = (1.0 - SENSOR_SHARE) * given.rate_per_hour * hours / max(len(given.traces), 1)
    widening = {}
    for test in dict.fromkeys((fit.name, fit.along) for fit in fits):
        same = [fit for fit in fits if (fit.name, fit.along) == test]
        scores, _ = _scores(same, given.others)
        level = return_level(scores[np.isfinite(scores)], share)
        widening[test] = max(1.0, float(np.nan_to_num(level)))
    return tuple(replace(fit, widening=widening[fit.name, fit.along]) for fit in fits)


def not_nominal(
    traces: Sequence[Trace],
    false_alarms_per_hour: float,
    period_s: float,
    tolerance: UnitTolerance,
    folds: Sequence[str],
    spread: Mapping[str, tuple[float, ...]],
    fitted: LimitFit,
    judged: Sequence[Trace] = (),
    terms: Sequence[ReadingTerm] = (),
) -> dict[str, str]:
    """Recordings that limits learned from the others show not to be nominal, with the reason.

    The farthest one is left out and the rest judged anew, for it has widened the limits of all. One
    under loads that none of the others carried cannot be judged by them.
    """
    left, found = list(range(len(traces))), dict[str, str]()
    while len(left) > LEAST_RECORDINGS and np.nanmax(fitted.scores, initial=0.0) > NOT_NOMINAL:
        scores = np.where(_covered([traces[k].loads for k in left]), fitted.scores, np.nan)
        if not np.nanmax(scores, initial=0.0) > NOT_NOMINAL:
            break
        worst = int(np.nanargmax(scores))
        score, test = float(scores[worst]), fitted.worst[worst]
        found[traces[left.pop(worst)].name] = (
            f"{test} reaches {score:.1f} times the limit that the other recordings give"
        )
        fitted = fit_limits(
            [traces[k] for k in left],
            false_alarms_per_hour,
            period_s,
            tolerance,
            [folds[k] for k in left],
            spread=spread,
            judged=[judged[k] for k in left] if judged else (),
            terms=terms,
        )
    return found


def _covered(loads: Sequence[Array]) -> Flags:
    """Whether most of each recording is under loads that the others have carried, shape (n,)."""
    if not all(len(each) for each in loads):
        return np.ones(len(loads), dtype=bool)
    lows, highs = (np.array([end(each, axis=0) for each in loads]) for end in (np.min, np.max))
    found = []
    for place, own in enumerate(loads):
        low, high = np.delete(lows, place, 0).min(axis=0), np.delete(highs, place, 0).max(axis=0)
        found.append(((low <= own) & (own <= high)).all(axis=1).mean() > 0.5)
    return np.array(found)


def _scores(fits: Sequence[WindowFit], others: Flags) -> tuple[Array, tuple[str, ...]]:
    """Largest score of each recording, NaN where none can be judged, and the test it is of."""
    if not fits:
        return np.full(len(others), np.nan), ("",) * len(others)
    table = np.array([fit.scores(others) for fit in fits])
    filled = np.where(np.isfinite(table), table, -np.inf)
    largest = filled.max(axis=0)
    worst = (fits[k] for k in filled.argmax(axis=0).tolist())
    words = tuple(fit.words for fit in worst)
    return np.where(np.isfinite(largest), largest, np.nan), words


def _correlation(windows: Sequence[WindowLimit], scatter: float) -> float:
    """Samples per independent sample: w var(mean) / var(sample), largest over all windows."""
    worst = max(limit.window * float(np.mean(limit.sigma)) ** 2 for limit in windows)
    return max(1.0, worst / scatter**2)
