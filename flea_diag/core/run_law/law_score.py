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

"""How well a law foretells recordings that it was learned without."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.law_noise import LawNoise
from flea_diag.core.run_law.restricted_likelihood import Spread
from flea_diag.core.run_law.run_law import LawScore
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import RunWindows

Array = npt.NDArray[np.float64]

HALF_LOG_2PI = 0.5 * float(np.log(2.0 * np.pi))
LEAST_VALUES = 10
"""Windows of a relation in a recording below which its mean is left out."""


def law_score(
    runs: Sequence[RunWindows], columns: Sequence[Array], noise: LawNoise, sums: RunSums,
    apart: Sequence[Spread],
) -> LawScore | None:  # fmt: skip
    """Score over recordings, each by the spread ``apart`` from it; None of fewer than three."""
    count = float(sums.count.sum())
    if len(runs) < 3 or count == 0.0:
        return None
    logs = sum(float(law.log_density(sums[k])) for k, law in enumerate(apart))
    means = np.concatenate([
        standardised_means(run, x, noise, law)
        for run, x, law in zip(runs, columns, apart, strict=True)
    ])  # fmt: skip
    return LawScore(
        logs / count - HALF_LOG_2PI,
        _separate(runs),
        float(np.sqrt(np.square(means).mean())) if len(means) else 0.0,
        float((np.abs(means) > 2.0).mean()) if len(means) else 0.0,
        len(means),
    )


def standardised_means(run: RunWindows, x: Array, noise: LawNoise, law: Spread) -> Array:
    """Mean of each relation over a recording, beside what the law expects, over its deviation."""
    known = np.isfinite(run.values)
    counts = known.sum(axis=0)
    share = known / np.maximum(counts, 1)
    mean_x = np.einsum("tr,trc->rc", share, x)
    off = (np.nan_to_num(run.values) * share).sum(axis=0) - mean_x @ law.mean
    total = np.diag(law.variance) + law.covariance
    variance = np.einsum("rc,cd,rd->r", mean_x, total, mean_x)
    variance += np.square(noise.long_run) / np.maximum(counts, 1)
    return np.asarray((off / np.sqrt(variance))[counts >= LEAST_VALUES])


def _separate(runs: Sequence[RunWindows]) -> float:
    """Score by one variance of windows a relation, that of the other recordings, and no more.

    This is what limits rest on whose noise holds what recordings differ by.
    """
    squares = np.array([np.nansum(np.square(run.values), axis=0) for run in runs])
    counts = np.array([np.isfinite(run.values).sum(axis=0) for run in runs])
    others = (squares.sum(axis=0) - squares) / np.maximum(counts.sum(axis=0) - counts, 1)
    others = np.maximum(others, 1e-300)
    nats = -0.5 * (squares / others + counts * np.log(2.0 * np.pi * others))
    return float(nats.sum() / max(counts.sum(), 1))
