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

"""Nominal ranges of level and kurtosis, learned for the rule that raises the vibration alarm.

One block beyond its range means nothing: ``RAISED`` of ``BLOCKS`` blocks raise the alarm. The ends
of a range are therefore set by what this rule reaches over whole healthy runs, not by single
blocks: units differ, and consecutive blocks of one unit are correlated. Beyond the observed runs
the limits follow extreme-value theory.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.nominal_range import (
    NominalRange,
    VibrationOperatingPoint,
    learn_nominal,
    tail_end,
)
from flea_diag.core.vibration.vibration_monitor import BLOCKS, RAISED

Levels = Sequence[tuple[VibrationOperatingPoint, Mapping[str, float]]]
"""Blocks of one healthy run in order of time: operating point, and an indicator by axis."""

LEAST_RUNS = 20  # assumption: size of a sample
LEAST_HALF_WIDTH = 0.3
"""Widening of a range, in the logarithm: sensors not learned from may differ by a third."""


def learn_levels(
    runs: Sequence[Levels], false_alarm_rate: float, moving: bool
) -> dict[str, NominalRange]:
    """Range of each axis that raises an alarm in a share of ``false_alarm_rate`` of healthy runs.

    The rate holds for runs of this length: units differ more than the blocks of one unit, but a
    longer run has more blocks. For blocks in motion or blocks at rest. Axes with fewer than
    ``LEAST_RUNS`` runs in which an alarm is possible are omitted.
    """
    return {
        axis: _range(axis, found, false_alarm_rate)
        for axis, found in usable_runs(runs, moving).items()
        if len(found) >= LEAST_RUNS
    }


def usable_runs(runs: Sequence[Levels], moving: bool) -> dict[str, list[Levels]]:
    """Blocks in motion, or at rest, of the runs in which they are enough for an alarm, by axis."""
    kept = [[row for row in run if row[0].moving == moving] for run in runs]
    kept = [run for run in kept if len(run) >= RAISED]
    axes = dict.fromkeys(axis for run in kept for _, levels in run for axis in levels)
    return {axis: [run for run in kept if axis in run[0][1]] for axis in axes}


def observed_rate(count: int) -> float:
    """Least share of alarms, of both ends of a range together, that ``count`` runs show."""
    return 2.0 / (count + 1)


def gumbel(rate: float) -> float:
    """Standard deviations above the mean that one more run exceeds with ``rate`` (Gumbel).

    The tail is heavier than that of a normal distribution: limits from a normal distribution gave
    three alarms in six hours for a stated rate of 0.1 per hour.
    """
    return (-math.log(-math.log1p(-rate)) - np.euler_gamma) * math.sqrt(6.0) / math.pi


def _range(axis: str, runs: Sequence[Levels], rate: float) -> NominalRange:
    """Centre fitted to single blocks, ends to the largest value of the rule in each run."""
    blocks = [(point, levels[axis]) for run in runs for point, levels in run]
    points, values = [point for point, _ in blocks], [level for _, level in blocks]
    centred = learn_nominal(values, rate, points, logarithmic=True)
    rests = [
        np.array([np.log(levels[axis]) - centred.centre(point) for point, levels in run])
        for run in runs
    ]
    above, below = (np.array([held(sign * rest) for rest in rests]) for sign in (1.0, -1.0))
    low, high = (max(_end(ends, rate / 2.0), LEAST_HALF_WIDTH) for ends in (below, above))
    return replace(centred, low=-low, high=high, count=len(runs))


def _end(ends: npt.NDArray[np.float64], rate: float) -> float:
    """Upper end that a new run exceeds with probability ``rate``, from the observed runs.

    By order statistics within the observed rates; beyond them by extreme-value theory, and never
    below the largest observed value.
    """
    if rate * (len(ends) + 1) >= 1.0:
        return tail_end(ends, rate)
    beyond = gumbel(rate) * float(ends.std(ddof=1))
    return max(float(ends.mean()) + beyond, float(ends.max()))


def held(values: npt.NDArray[np.float64]) -> float:
    """Highest limit reached by ``RAISED`` of any ``BLOCKS`` consecutive values."""
    size = min(BLOCKS, len(values))
    rows = np.sort(np.lib.stride_tricks.sliding_window_view(values, size), axis=1)
    return float(rows[:, size - RAISED].max())
