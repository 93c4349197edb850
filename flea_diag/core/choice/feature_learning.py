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

"""Learning a fault feature table from labelled windows: ranges, ranking, selection, entries.

Good features vary strongly between faults and little within one, are cheap and not redundant
(Narasimhan et al. 2010, section 3.2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np
import numpy.typing as npt

from flea_diag.core.choice.feature_table import UNAFFECTED
from flea_diag.core.vibration.features import FeatureId
from flea_diag.core.vibration.nominal_range import (
    LEAST_WINDOWS,
    NominalRange,
    VibrationOperatingPoint,
    learn_nominal,
)
from flea_diag.errors import CalibrationError

NOMINAL = UNAFFECTED
SYMBOLS = ("--", "-", "0", "0^", "+", "++")

Ends = tuple[float, float, float]
"""Ends of "much below", "much above" and the upper part, in half widths of the range."""
WIDTHS = (1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0)  # those tried, a factor of 1.4 apart
UPPER = (1.0, 0.7, 0.4, 0.1, -0.2)
"""Candidates for the start of the upper part of the range; 1: no upper part."""
ALL_ENDS: tuple[Ends, ...] = tuple(product(WIDTHS, WIDTHS, UPPER))
"""All candidates."""

ENOUGH_EVIDENCE = 4.5
"""Sum of Bhattacharyya distances at which a pair of faults counts as split: for independent
features the odds of confusing the two are below exp(-4.5)."""

LEAST_GAIN = 0.1
"""Evidence per square root of cost for which a further feature is worth its place; assumption."""
REDUNDANT = 0.9
"""Correlation from which on two features say the same, four fifths of the variance; assumption."""


@dataclass(frozen=True)
class Sample:
    """Feature values of one window of a run in which ``fault`` was present throughout.

    ``reverses``: whether motion or load reverses in the window.
    """

    fault: str
    point: VibrationOperatingPoint
    values: Mapping[str, float]
    reverses: bool = True

    @property
    def moving(self) -> bool:
        """Whether the shaft turned enough to show a mechanical fault."""
        return self.point.moving


@dataclass(frozen=True)
class FeatureStatistics:
    """Nominal ranges and, on their scale, the windows in motion of each fault.

    ``deviations``: feature to fault to (windows,), -1 and +1 at the ends of the range.
    """

    ranges: Mapping[str, NominalRange]
    deviations: Mapping[str, Mapping[str, npt.NDArray[np.float64]]] = field(repr=False)
    counts: Mapping[str, int]

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults seen, without nominal."""
        return tuple(fault for fault in self.counts if fault != NOMINAL)

    def range_of(self, feature: str, ends: Ends) -> NominalRange:
        """Nominal range of a feature with the ends of its symbols."""
        low, high, upper = ends
        return replace(self.ranges[feature], much=(low, high), upper=upper)

    def probability(self, fault: str, feature: str, ends: Ends) -> tuple[float, ...]:
        """P(symbol) of ``SYMBOLS``, divided at these ``ends``."""
        (found,) = self.probabilities(fault, feature, (ends,)).tolist()
        return tuple(found)

    def probabilities(
        self, fault: str, feature: str, choices: Sequence[Ends]
    ) -> npt.NDArray[np.float64]:
        """P(symbol) for each choice of ends, shape (choices, symbols).

        Relative counts of windows, with half a count added to each symbol so that none is 0.
        """
        values = self.deviations[feature][fault]
        known = np.sort(values[~np.isnan(values)])
        low, high, upper = np.array(choices, dtype=float).T
        one = np.ones(len(choices))
        below = np.searchsorted(known, (-low, -one), "left")
        upto = np.searchsorted(known, (upper, one, high), "right")
        all_of_them = np.full((1, len(choices)), len(known))
        counts = np.diff(np.concatenate((0 * all_of_them, below, upto, all_of_them)), axis=0).T
        return np.ascontiguousarray((counts + 0.5) / (len(known) + 0.5 * len(SYMBOLS)))


@dataclass(frozen=True)
class Score:
    """Score of a feature: see `rank`."""

    feature: str
    variance_ratio: float
    auc: float
    information_bit: float
    cost: float


def learn(
    samples: Sequence[Sample], features: Sequence[str], false_alarm_rate: float
) -> FeatureStatistics:
    """Nominal ranges at a false-alarm rate, and the windows of each fault relative to them.

    Features without a nominal range are omitted.

    Raises
    ------
    CalibrationError
        Without nominal windows or with too few, or without any moving window of a fault.
    """
    nominal = [sample for sample in samples if sample.fault == NOMINAL]
    moving = [sample for sample in samples if sample.moving]
    names = sorted({sample.fault for sample in moving})
    if not nominal or set(names) <= {NOMINAL}:
        raise CalibrationError(
            f"{len(nominal)} nominal and {len(samples) - len(nominal)} faulty windows: "
            "a table needs both, with motion"
        )
    if len(nominal) < LEAST_WINDOWS:
        raise CalibrationError(
            f"{len(nominal)} nominal windows make no range, {LEAST_WINDOWS} are needed: give more "
            "nominal recordings"
        )
    found = {feature: _range(nominal, feature, false_alarm_rate) for feature in features}
    ranges = {feature: range_ for feature, range_ in found.items() if range_ is not None}
    classes = {name: [sample for sample in moving if sample.fault == name] for name in names}
    deviations = {
        feature: {
            name: np.array([_deviation(range_, sample, feature) for sample in rows])
            for name, rows in classes.items()
        }
        for feature, range_ in ranges.items()
    }
    return FeatureStatistics(
        ranges, deviations, {name: len(rows) for name, rows in classes.items()}
    )


def rank(learned: FeatureStatistics, costs: Mapping[str, float]) -> list[Score]:
    """Features by information per cost, best first.

    ``variance_ratio``: between-class over within-class variance of the deviations, compressed to
    a few ranges so that outliers do not dominate. ``auc``: mean over the faults of the area under
    the ROC curve against nominal, on either side. ``information_bit``: mutual information of
    symbol and fault, all faults equally likely, with "much" from 4 half widths.
    """
    scores = [
        Score(
            feature,
            _variance_ratio(learned, feature),
            _auc(learned, feature),
            _information(learned, feature),
            costs[feature],
        )
        for feature in learned.ranges
    ]
    return sorted(scores, key=lambda score: (-score.information_bit / score.cost, score.feature))


def select(
    learned: FeatureStatistics, costs: Mapping[str, float], most: int, kept: Sequence[str] = ()
) -> dict[str, Ends]:
    """Features, with the ends of their symbols, that together split every pair of faults.

    Greedy, starting with ``kept``: the feature that adds most evidence for pairs not yet split,
    per square root of cost. Features correlated above ``REDUNDANT`` with a chosen one are omitted.
    """
    pairs = list(combinations(learned.faults, 2))
    evidence = {feature: _evidence(learned, feature, pairs) for feature in learned.ranges}
    missing = np.full(len(pairs), ENOUGH_EVIDENCE)
    chosen: dict[str, Ends] = {}
    waiting = list(kept)
    while len(chosen) < most:
        left = waiting[:1] or [
            feature
            for feature in evidence
            if feature not in chosen and not _redundant(learned, feature, chosen)
        ]
        gains = {
            feature: np.minimum(evidence[feature], missing).sum(axis=1) / costs[feature] ** 0.5
            for feature in left
        }
        best = max(left, key=lambda feature: float(gains[feature].max()), default=None)
        if best is None or (not waiting and gains[best].max() < LEAST_GAIN):
            break
        waiting = waiting[1:]
        place = int(np.argmax(gains[best]))
        chosen[best] = ALL_ENDS[place]
        missing = np.maximum(missing - evidence[best][place], 0.0)
    return chosen


def _range(nominal: Sequence[Sample], feature: str, rate: float) -> NominalRange | None:
    logarithmic = FeatureId.parse(feature).feature.logarithmic
    values = np.array([sample.values.get(feature, math.nan) for sample in nominal])
    if logarithmic:
        values = np.where(values > 0.0, values, math.nan)
    points = [sample.point for sample in nominal]
    try:
        return learn_nominal(values, rate, points, logarithmic=logarithmic)
    except CalibrationError:
        return None


def _deviation(found: NominalRange, sample: Sample, feature: str) -> float:
    value = sample.values.get(feature, math.nan)
    return math.nan if math.isnan(value) else found.deviation(value, sample.point)


def _evidence(
    learned: FeatureStatistics, feature: str, pairs: Sequence[tuple[str, str]]
) -> npt.NDArray[np.float64]:
    """Bhattacharyya distance of each pair at each choice of ends, shape (ends, pairs).

    Weighted by the share of windows in which the feature is computable.
    """
    rows = np.stack([learned.probabilities(f, feature, ALL_ENDS) for f in learned.faults], axis=1)
    roots = np.sqrt(rows)
    places = {fault: place for place, fault in enumerate(learned.faults)}
    first = roots[:, [places[a] for a, _ in pairs]]
    second = roots[:, [places[b] for _, b in pairs]]
    known = {f: np.isfinite(learned.deviations[feature][f]).mean() for f in learned.faults}
    coverage = np.array([min(known[a], known[b]) for a, b in pairs])
    return np.asarray(-np.log((first * second).sum(axis=2)) * coverage)


def _variance_ratio(learned: FeatureStatistics, feature: str) -> float:
    """Fisher's ratio of classes of equal weight."""
    classes = [np.tanh(values / 3.0) for values in learned.deviations[feature].values()]
    classes = [values[np.isfinite(values)] for values in classes]
    classes = [values for values in classes if len(values) > 1]
    within = float(np.mean([values.var() for values in classes])) if classes else 0.0
    between = float(np.var([values.mean() for values in classes])) if classes else 0.0
    return between / within if within > 0.0 else math.inf


def _auc(learned: FeatureStatistics, feature: str) -> float:
    """Mean over faults of the AUC against nominal, folded to 0.5 and above."""
    values = {fault: v[~np.isnan(v)] for fault, v in learned.deviations[feature].items()}
    healthy = np.sort(values.get(NOMINAL, np.empty(0)))
    areas = []
    for fault in learned.faults:
        if len(healthy) and len(values[fault]):
            below = np.searchsorted(healthy, values[fault], "left")
            upto = np.searchsorted(healthy, values[fault], "right")
            area = float(np.mean(below + upto)) / (2.0 * len(healthy))
            areas.append(max(area, 1.0 - area))
    return float(np.mean(areas)) if areas else 0.5


def _information(learned: FeatureStatistics, feature: str) -> float:
    """Mutual information of symbol and fault in bits, all faults equally likely."""
    rows = np.array([learned.probability(f, feature, (4.0, 4.0, 1.0)) for f in learned.faults])
    return float(np.mean(np.sum(rows * np.log2(rows / rows.mean(axis=0)), axis=1)))


def nearest(learned: FeatureStatistics, feature: str, chosen: Iterable[str]) -> tuple[str, float]:
    """The chosen feature most correlated with this one, and the absolute correlation.

    Pearson's, of the compressed deviations over the windows in motion of all faults; ("", 0) if
    there is none to compare with.
    """
    one = _all_windows(learned, feature)
    found = {name: _correlation(one, _all_windows(learned, name)) for name in chosen}
    best = max(found, key=found.__getitem__, default="")
    return best, found.get(best, 0.0)


def _redundant(learned: FeatureStatistics, feature: str, chosen: Iterable[str]) -> bool:
    return nearest(learned, feature, chosen)[1] > REDUNDANT


def _correlation(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> float:
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < 3 or one[both].std() == 0.0 or other[both].std() == 0.0:
        return 0.0
    return abs(float(np.corrcoef(one[both], other[both])[0, 1]))


def _all_windows(learned: FeatureStatistics, feature: str) -> npt.NDArray[np.float64]:
    return np.tanh(np.concatenate(list(learned.deviations[feature].values())) / 3.0)
