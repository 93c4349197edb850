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

"""Comparison of the simulated stand with the real one by the same statistics of both.

Real runs are text files of the public FLEA recordings; each is simulated with its own motion
and mean load. The simulator was tuned on one half of the runs (``tuning``); only the other half
(``held out``) is an unbiased comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flea_sim_driver.acquisition.recording import RunSignals, read_real, simulate
from flea_sim_driver.realism.run_statistics import STATISTICS


@dataclass(frozen=True)
class Comparison:
    """One statistic of one run: real, simulated, and the distance |ln(sim / real)|."""

    run: str
    label: str
    half: str
    statistic: str
    unit: str
    real: float
    simulated: float

    @property
    def distance(self) -> float:
        """Magnitude of the log ratio: 0.1 is ten per cent; NaN if the real value is unusable."""
        if not (self.real > 0.0 and self.simulated > 0.0):
            return float("nan")
        return abs(float(np.log(self.simulated / self.real)))


def compare(
    paths: list[Path], seed: int, keep: Callable[[RunSignals, RunSignals, str], None] | None = None
) -> list[Comparison]:
    """All statistics of all runs; every other run of a label is held out."""
    rows: list[Comparison] = []
    seen: dict[str, int] = {}
    for number, path in enumerate(sorted(paths)):
        real = read_real(path)
        count = seen[real.label] = seen.get(real.label, 0) + 1
        half = "tuning" if count % 2 else "held out"
        simulated = simulate(real, seed + number)
        rows += [
            Comparison(real.name, real.label, half, name, row.unit, row.of(real), row.of(simulated))
            for name, row in STATISTICS.items()
        ]
        if keep is not None:
            keep(real, simulated, half)
    return rows


@dataclass(frozen=True)
class Summary:
    """One statistic over the runs of one label and half."""

    label: str
    half: str
    statistic: str
    unit: str
    runs: int
    real: float
    simulated: float
    distance: float
    bias: float


def summaries(rows: list[Comparison]) -> list[Summary]:
    """Medians over runs; ``bias`` is the median log ratio with its sign."""
    keys = dict.fromkeys((row.half, row.label, row.statistic, row.unit) for row in rows)
    return [_summary(key, rows) for key in keys]


def _summary(key: tuple[str, str, str, str], rows: list[Comparison]) -> Summary:
    half, label, statistic, unit = key
    usable = [
        row
        for row in rows
        if (row.half, row.label, row.statistic) == key[:3] and np.isfinite(row.distance)
    ]
    nan = float("nan")
    if not usable:
        return Summary(label, half, statistic, unit, 0, nan, nan, nan, nan)
    ratios = np.log([row.simulated / row.real for row in usable])
    return Summary(
        label, half, statistic, unit, len(usable),
        float(np.median([row.real for row in usable])),
        float(np.median([row.simulated for row in usable])),
        float(np.median(np.abs(ratios))), float(np.median(ratios)),
    )  # fmt: skip
