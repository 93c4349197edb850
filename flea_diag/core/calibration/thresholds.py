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

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.extreme_value import return_level
from flea_diag.core.calibration.nominal_trace import Trace, coefficient_shifts, own_noise
from flea_diag.core.calibration.out_of_sample import OutOfSample
from flea_diag.core.calibration.promise import LEAST_RECORDINGS
from flea_diag.core.calibration.window_fit import WindowFit, WindowStatistic, others_of, window_fit
from flea_diag.core.detection.coefficient_shift import COEFFICIENT_WINDOWS_S
from flea_diag.core.detection.mean_shift import SHIFT_WINDOWS_S, MeanShift, MeanShiftLimit
from flea_diag.core.detection.window_limit import SPEED_REGIONS_M_S, ResidualLimit, WindowLimit
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitTolerance
from flea_diag.core.residuals.residual_rows import ReadingTerm, ResidualRow, ResidualSet
from flea_diag.core.residuals.thermal import CORRECTION_S
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.sensor_limits import SENSOR_SHARE

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

PIECE_S = 10.0  # assumption: size of a sample
NOT_NOMINAL = 1.7
"""Score of a recording beyond which it is not taken for nominal. The 29 nominal recordings of the
FLEA reach 0.87, six of its jams, each among them, 2.2 to 3.8."""
SHIFT_SHARE = 0.1
"""Share of the false-alarm rate allotted to mean-shift tests."""
REGIONS = len(SPEED_REGIONS_M_S) + 1


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


LEARNED = ("voltage_offset_v", "current_offset_a")
"""What a diagnosis learns of the unit in its first seconds."""


@dataclass(frozen=True)
class _Tests:
    """What all tests of one calibration share."""

    traces: Sequence[Trace]
    judged: Sequence[Trace]
    others: Flags
    tolerance: UnitTolerance
    rate_per_hour: float
    period_s: float
    spread: Mapping[str, tuple[float, ...]]
    terms: Sequence[ReadingTerm]

    @property
    def rows(self) -> ResidualSet:
        """The residuals of the stand."""
        return self.traces[0].rows

    @property
    def counts(self) -> ScanCounts:
        """Counts of scans at their rate."""
        return ScanCounts(self.period_s)

    def differing_of(self, units: Sequence[int]) -> Array:
        """Spread of healthy units in some parameters, before anything is learned."""
        return np.array([getattr(self.tolerance, UNIT_PARAMETERS[k]) for k in units])

    @property
    def differing(self) -> Array:
        """Spread of healthy units by parameter, without what a diagnosis learns."""
        sigmas = (0.0 if n in LEARNED else getattr(self.tolerance, n) for n in UNIT_PARAMETERS)
        return np.array(list(sigmas))

    def student(self, rate_per_hour: float, window: int, samples: int) -> float:
        """Limit of a test that shares ``rate_per_hour``, from so many nominal samples."""
        pieces = samples * self.period_s / PIECE_S
        alpha = rate_per_hour * window * self.period_s / 3600.0
        return _student(alpha, max(pieces - 1.0, 2.0))

    def extra(self, row: ResidualRow) -> float:
        """Variance that units differ by in every scan alike: of heating rates, of innovations."""
        if row.name in self.spread:
            return float(np.square(np.array(self.spread[row.name]) * self.differing).sum())
        return (self.tolerance.thermal_rate_k_per_s * CORRECTION_S) ** 2 * (
            row.name in self.rows.predictions
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
    given = _Tests(
        traces, judged or traces, others, tolerance, false_alarms_per_hour, period_s, spread, terms
    )
    tests, scatter = _z_tests(given)
    between = {fit.name: 0.0 for fit in tests}
    for fit in tests:
        between[fit.name] = max(between[fit.name], max(fit.sigma) ** 2)
    shifts = _shift_tests(given, between)
    scores, worst = _scores((*tests, *shifts), others)
    tests, shifts = (_widened(fits, given) for fits in (tests, shifts))
    return LimitFit(tests, shifts, scatter, spread, scores, worst, false_alarms_per_hour)


def _widened(fits: tuple[WindowFit, ...], given: _Tests) -> tuple[WindowFit, ...]:
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

    The farthest one is left out and the rest judged anew, for it has widened the limits of all.
    """
    left, found = list(range(len(traces))), dict[str, str]()
    while len(left) > LEAST_RECORDINGS and np.nanmax(fitted.scores, initial=0.0) > NOT_NOMINAL:
        worst = int(np.nanargmax(fitted.scores))
        score, test = float(fitted.scores[worst]), fitted.worst[worst]
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


def _z_tests(given: _Tests) -> tuple[tuple[WindowFit, ...], dict[str, float]]:
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


def _shift_tests(given: _Tests, between: Mapping[str, float]) -> tuple[WindowFit, ...]:
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
    name: str, given: _Tests, between: float, least_k: Callable[[int], float]
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


def _shifts(row: ResidualRow, column: int, entry: Trace, given: _Tests) -> Array:
    """Shifts of a residual and of what units differ by, (scans, windows, 1 + unit parameters)."""
    gated = row.gate == "moving"
    use = entry.moving[:, None] | (not gated)
    spread = _spread_of(entry, column) * given.differing
    values = np.concatenate((entry.values[:, [column]], spread), axis=1)
    level = MeanShift([gated], values.shape[1], counts=given.counts)
    return level.step(values[:, None], use)[:, 0]


def _spread_of(entry: Trace, column: int) -> Array:
    """D r / d theta of healthy units, shape (scans, unit parameters); 0 where they are alike."""
    if entry.spread is None or column not in entry.rows.spreading:
        return np.zeros((len(entry.values), len(UNIT_PARAMETERS)))
    return np.nan_to_num(entry.spread[:, entry.rows.spreading.index(column)])


def _gated(row: ResidualRow, index: int, entry: Trace) -> tuple[Array, Array, Array]:
    """Values of a residual where it is tested, the speed, and what units differ by there."""
    values = entry.values[:, index]
    use = np.isfinite(values)
    if row.gate == "moving":
        use &= entry.moving
    return values[use], np.nan_to_num(entry.speed_m_s[use]), _spread_of(entry, index)[use]


def _means(
    column: tuple[Array, Array, Array], window: int, differing: Array, extra: float
) -> WindowStatistic:
    """Windowed means of one recording, the region of the mean speed, what units differ by."""
    values, speed, spread = column
    if len(values) < window:
        return WindowStatistic(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0))
    region = np.searchsorted(SPEED_REGIONS_M_S, _rolling(speed, window))
    unit = np.square(_rolling(spread, window) * differing).sum(axis=1)
    return WindowStatistic(
        _rolling(values, window), np.asarray(region, dtype=np.int64), unit + extra
    )


def _rolling(values: Array, window: int) -> Array:
    """Means over ``window`` rows."""
    sums = np.concatenate((np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)))
    rolled: Array = (sums[window:] - sums[:-window]) / window
    return rolled


def _correlation(windows: Sequence[WindowLimit], scatter: float) -> float:
    """Samples per independent sample: w var(mean) / var(sample), largest over all windows."""
    worst = max(limit.window * float(np.mean(limit.sigma)) ** 2 for limit in windows)
    return max(1.0, worst / scatter**2)


def _student(alpha: float, degrees: float) -> float:
    from scipy.special import stdtrit

    return float(-stdtrit(degrees, min(alpha, 0.5) / 2.0))
