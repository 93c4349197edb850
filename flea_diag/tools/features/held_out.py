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

"""How often a single window drops the fault that is there, on runs not learned from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import permutations

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_learning import SYMBOLS, FeatureStatistics, learn, select
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.tools.features.judge import walk
from flea_diag.tools.features.samples import FeatureRun

Pair = tuple[str, str]


def window_errors(
    runs: Sequence[FeatureRun],
    costs: Mapping[str, float],
    kept: Sequence[str],
    false_alarm_rate: float,
    most: int,
) -> dict[str, dict[str, float]]:
    """Share of windows whose features drop the fault that is there, by the fault and each other.

    Nominal windows stand for the faults that act on no feature. Runs are learned from and tried by
    halves in turn, all windows of a run on one side. Half a count is added, as in the entries: few
    windows promise little.

    Raises
    ------
    CalibrationError
        One half alone has too few nominal windows for a range.
    """
    walks: list[tuple[Pair, bool]] = []
    for first in (0, 1):
        samples = [sample for run in runs[first::2] for sample in run.samples]
        learned = learn(samples, list(costs), false_alarm_rate)
        table = _table(learned, costs, [name for name in kept if name in learned.ranges], most)
        walks += walked(runs[1 - first :: 2], table.of_vibration())
    return errors_of(walks)


def errors_of(walks: Sequence[tuple[Pair, bool]]) -> dict[str, dict[str, float]]:
    """The same of walks of single windows: each with its pair, and whether it kept the former."""
    tried = Counter(pair for pair, _ in walks)
    dropped = Counter(pair for pair, kept in walks if not kept)
    found: dict[str, dict[str, float]] = {}
    for (there, other), count in tried.items():
        error = (dropped[there, other] + 0.5) / (count + 1.0)
        found.setdefault(there, {})[other] = round(error, 4)
    return found


def _table(
    learned: FeatureStatistics, costs: Mapping[str, float], kept: Sequence[str], most: int
) -> FaultFeatureTable:
    """What a table file of these statistics would hold, of the features that are asked for."""
    chosen = select(learned, costs, most, kept)
    ranges = {feature: learned.range_of(feature, ends) for feature, ends in chosen.items()}
    entries = {
        (fault, feature): learned.probability(fault, feature, ends)
        for fault in learned.counts
        for feature, ends in chosen.items()
    }
    asked = {feature: costs[feature] for feature in chosen}
    return FaultFeatureTable("", SYMBOLS, asked, entries, nominal=NominalRanges(ranges=ranges))


def walked(runs: Sequence[FeatureRun], table: FaultFeatureTable) -> list[tuple[Pair, bool]]:
    """Each window of a fault beside each other fault, and whether its walk keeps the fault."""
    chooser = FeatureChooser(table)
    windows = [sample for run in runs for sample in run.typical]
    return [
        (pair, walk([sample], chooser, pair).kept)
        for pair in permutations(table.faults, 2)
        for sample in windows
        if sample.fault == pair[0]
    ]
