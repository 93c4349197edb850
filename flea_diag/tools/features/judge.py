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

"""Score of a fault feature table: walks through its tree on runs that it was not learned from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

from flea_diag.core.choice.diagnosis_tree import follow
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_learning import Sample
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.interval import wilson


@dataclass(frozen=True)
class Walk:
    """Result of one walk."""

    truth: str
    left: tuple[str, ...]
    asked: tuple[str, ...]
    cost: float

    @property
    def resolved(self) -> bool:
        """Whether only the true fault remains."""
        return self.left == (self.truth,)

    @property
    def kept(self) -> bool:
        """Whether the true fault remains."""
        return self.truth in self.left


def judge(
    runs: Sequence[FeatureRun],
    table: FaultFeatureTable,
    group: Sequence[str],
    strategy: str = "optimal",
    windows: int = 1,
) -> list[Walk]:
    """One walk per run with a fault of the group, on the first windows with the fault."""
    chooser = FeatureChooser(table, strategy)
    walks: list[Walk] = []
    for run in runs:
        samples = run.asked(group, windows)
        if samples:
            walks.append(walk(samples, chooser, group))
    return walks


def walk(samples: Sequence[Sample], chooser: FeatureChooser, group: Sequence[str]) -> Walk:
    """Walk from equal probabilities to a leaf; continue on the next window if several remain."""
    left: Mapping[str, float] = dict.fromkeys(group, 1.0)
    asked: list[str] = []
    for sample in samples:
        left, features = follow(left, chooser, partial(_symbol, chooser.table, sample))
        asked += features
    ranked = tuple(sorted(left, key=lambda fault: (-left[fault], fault)))
    cost = math.fsum(chooser.table.costs[feature] for feature in asked)
    return Walk(samples[0].fault, ranked, tuple(asked), cost)


def _symbol(table: FaultFeatureTable, sample: Sample, feature: str) -> str:
    value = sample.values.get(feature, math.nan)
    return table.nominal.symbol(feature, value, sample.point)


def judge_pairs(
    runs: Sequence[FeatureRun],
    table: FaultFeatureTable,
    group: Sequence[str],
    strategy: str = "optimal",
    windows: int = 1,
) -> dict[tuple[str, str], list[Walk]]:
    """Walks from a group of two faults, for each two of the group."""
    return {pair: judge(runs, table, pair, strategy, windows) for pair in combinations(group, 2)}


def pair_report(pairs: Mapping[tuple[str, str], Sequence[Walk]]) -> str:
    """Table of all pairs of the group: runs resolved from a group of these two faults."""
    lines = [f"{'pair':48s}{'n':>5s}{'resolved':>10s}{'95 %':>17s}{'kept':>7s}"]
    for pair, walks in pairs.items():
        n, hits = len(walks), sum(row.resolved for row in walks)
        if walks:
            low, high = wilson(hits, n)
            kept = sum(row.kept for row in walks) / n
            interval = f"{low:.3f} to {high:.3f}"
            lines.append(f"{' | '.join(pair):48s}{n:5d}{hits / n:10.3f}{interval:>17s}{kept:7.3f}")
    return "\n".join(lines)


def report(walks: Sequence[Walk]) -> str:
    """Table by fault: runs, shares with the true fault resolved and kept, size, features, cost."""
    head = f"{'fault':24s}{'n':>5s}{'resolved':>10s}{'95 %':>17s}{'kept':>7s}"
    lines = [head + f"{'size':>6s}{'features':>10s}{'cost':>7s}"]
    for fault in dict.fromkeys(row.truth for row in walks):
        lines.append(_line(fault, [row for row in walks if row.truth == fault]))
    return "\n".join([*lines, _line("all", walks)] if walks else [*lines, "no runs"])


def _line(name: str, walks: Sequence[Walk]) -> str:
    n = len(walks)
    hits = sum(row.resolved for row in walks)
    low, high = wilson(hits, n)
    kept = sum(row.kept for row in walks) / n
    size, asked, cost = (
        math.fsum(values) / n
        for values in zip(*((len(r.left), len(r.asked), r.cost) for r in walks), strict=True)
    )
    interval = f"{low:.3f} to {high:.3f}"
    shares = f"{name:24s}{n:5d}{hits / n:10.3f}{interval:>17s}{kept:7.3f}"
    return shares + f"{size:6.2f}{asked:10.2f}{cost:7.2f}"
