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

"""Evidence of whole recordings by a law, offline: nothing, another unit, or a fault."""

from __future__ import annotations

import itertools
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from flea_diag.core.run_law.run_sums import RunSums

WIDE = 10.0
"""Prior standard deviation of a size, in its standard errors."""
SMOOTHED = 2
NOTHING, UNIT = "nothing", "another unit"


@dataclass(frozen=True)
class Weighed:
    """Log evidence over nothing of another unit and of each fault, and the sizes of the latter.

    ``with_unit``: of each fault over another unit alone, in another unit.
    """

    unit: float
    faults: dict[str, float]
    sizes: dict[str, Any]
    with_unit: dict[str, float]

    @property
    def best(self) -> tuple[str, float]:
        """The best fault, of this unit or of another one."""
        return max(self.every.items(), key=lambda entry: entry[1])

    @property
    def every(self) -> dict[str, float]:
        """Evidence of each fault, of this unit or of another one that has it."""
        both = {name: self.unit + nats for name, nats in self.with_unit.items()}
        return {f: float(np.logaddexp(n, both[f])) - math.log(2.0) for f, n in self.faults.items()}

    @property
    def over_null(self) -> float:
        """Nats of the best fault over the better of nothing and another unit."""
        return self.best[1] - max(0.0, self.unit)

    def group(self, within: float = 3.5) -> set[str]:
        """Faults within so many nats of the best."""
        return {name for name, nats in self.every.items() if self.best[1] - nats <= within}


def weighed(
    law: Any, columns: Any, faults: Any, run: Any, unit: Any, onset: int = 0, switched: int = -1
) -> Weighed:
    """Evidence from a window on; ``unit``: variances of another unit, ``switched``: its window."""
    values = run.values.copy()
    for at in (onset, switched):
        # What smoothing makes of a step is neither before nor after it.
        values[max(at, 0) : max(at, 0) + SMOOTHED * (at > 0)] = np.nan
    run = replace(run, values=values)
    own = columns.of(run)
    later = np.where(np.arange(len(run))[:, None, None] >= onset, own, 0.0)
    before = np.where(np.arange(len(run))[:, None, None] >= switched, own, 0.0)
    count = own.shape[-1]
    white = law.law_noise.whitened(
        run, np.concatenate((own, before, later, faults.of(run, onset)), axis=-1)
    )
    total = np.concatenate((law.run_variance, unit if switched >= 0 else 0.0 * unit))
    sums = RunSums.of(white.bounded(_rough(white, law.mean, total, 2 * count)))
    sums = sums.beside(np.concatenate((law.mean, np.zeros(sums.gram.shape[0] - count))))
    another, found, sizes = _evidence(sums, total, unit, count, faults)
    if onset:
        # A fault in a unit that comes with it is no hypothesis of its own.
        return Weighed(another, found, sizes, dict.fromkeys(found, -math.inf))
    anew = np.concatenate((total[:count] + unit, total[count:]))
    _, with_unit, _ = _evidence(sums, anew, unit, count, faults)
    return Weighed(another, found, sizes, with_unit)


def _evidence(sums: Any, total: Any, unit: Any, count: int, faults: Any) -> Any:
    """Another unit and each fault, with coefficients of these variances integrated out."""
    sigma = np.sqrt(total)
    base = np.s_[: 2 * count]
    inner = np.eye(2 * count) + sigma[:, None] * sums.gram[base, base] * sigma
    kept = sigma[:, None] * np.linalg.inv(inner) * sigma
    mixed = sums.gram[:, base]
    gram = sums.gram - mixed @ kept @ mixed.T
    cross = sums.cross - mixed @ kept @ sums.cross[base]
    another = _marginal(gram, cross, slice(2 * count, 3 * count), np.sqrt(unit))
    start = 3 * count
    found, sizes = {}, {}
    for name in dict.fromkeys(column.fault for column in faults.columns):
        which = [start + k for k, column in enumerate(faults.columns) if column.fault == name]
        found[name], sizes[name] = _best_sizes(gram, cross, which, faults, start)
    return another, found, sizes


def _rough(white: Any, mean: Any, total: Any, count: int) -> Any:
    """Coefficients beside which far-out windows are bounded."""
    sums = RunSums.of(white).first(count)
    prior = np.diag(1.0 / np.maximum(100.0 * total, 1e-12))
    fit = np.linalg.solve(sums.gram + prior, sums.cross)
    return np.concatenate((fit, np.zeros(white.rows.shape[-1] - 1 - count)))


def _marginal(gram: Any, cross: Any, which: Any, sigma: Any) -> float:
    """Log evidence of normal coefficients of these deviations over none."""
    A = np.eye(len(sigma)) + sigma[:, None] * gram[which, which] * sigma
    b = sigma * cross[which]
    return 0.5 * float(b @ np.linalg.solve(A, b) - np.linalg.slogdet(A)[1])


def _best_sizes(gram: Any, cross: Any, which: list[int], faults: Any, start: int) -> Any:
    """Evidence of a fault with the sizes that its signs allow, at the price of each."""
    best, sizes = -math.inf, None
    for r in range(1, len(which) + 1):
        for some in itertools.combinations(which, r):
            index = np.array(some)
            block = gram[np.ix_(index, index)]
            if np.linalg.cond(block) > 1e12:
                continue
            fit = np.linalg.solve(block, cross[index])
            rows = [faults.columns[k - start] for k in some]
            if any(not row.low <= size <= row.high for row, size in zip(rows, fit, strict=True)):
                continue
            nats = 0.5 * (1 - 1 / WIDE**2) * float(cross[index] @ fit) - r * math.log(WIDE)
            if nats > best:
                best, sizes = nats, dict(zip((row.size for row in rows), fit.tolist(), strict=True))
    return best, sizes
