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

LEAST_RUNS = 20
LEAST_HALF_WIDTH = 0.3
"""Of a range, in the logarithm: sensors that were not learned from may differ by a third."""


def learn_levels(
    runs: Sequence[Levels], false_alarm_rate: float, moving: bool
) -> dict[str, NominalRange]:
    """Range of each axis that raises an alarm in a share of ``false_alarm_rate`` of healthy runs.

    Of runs as long as these: units differ more than the blocks of one, but a longer run has more
    of them. Of blocks in motion, or of those at rest. Axes with fewer than ``LEAST_RUNS`` runs
    that could raise an alarm at all are left out.
    """
    kept = [[row for row in run if row[0].moving == moving] for run in runs]
    kept = [run for run in kept if len(run) >= RAISED]
    axes = dict.fromkeys(axis for run in kept for _, levels in run for axis in levels)
    by_axis = {axis: [run for run in kept if axis in run[0][1]] for axis in axes}
    return {
        axis: _range(axis, found, false_alarm_rate)
        for axis, found in by_axis.items()
        if len(found) >= LEAST_RUNS
    }


def gumbel(rate: float) -> float:
    """Deviations from the mean that one more passes with ``rate``, by Gumbel's law of the largest.

    Its tail is heavier than a normal one: the level of healthy units differs near normally, but
    limits by that law called three times in six hours where 0.1 an hour were stated.
    """
    return (-math.log(-math.log1p(-rate)) - np.euler_gamma) * math.sqrt(6.0) / math.pi


def _range(axis: str, runs: Sequence[Levels], rate: float) -> NominalRange:
    """Centre fitted to single blocks, ends to what the rule saw of each run at most."""
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
    """Upper end that a new run passes with probability ``rate``, from those of the runs seen.

    Their order statistics as far as these reach; beyond, the law of extremes, and never less than
    the largest seen.
    """
    if rate * (len(ends) + 1) >= 1.0:
        return tail_end(ends, rate)
    beyond = gumbel(rate) * float(ends.std(ddof=1))
    return max(float(ends.mean()) + beyond, float(ends.max()))


def held(values: npt.NDArray[np.float64]) -> float:
    """Highest limit that ``RAISED`` of some ``BLOCKS`` values in a row come up to."""
    size = min(BLOCKS, len(values))
    rows = np.sort(np.lib.stride_tricks.sliding_window_view(values, size), axis=1)
    return float(rows[:, size - RAISED].max())
