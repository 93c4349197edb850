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

"""What each sensor does by itself in nominal recordings: its noise, its steps, its repeats.

Nothing here needs a model of the actuator: a sensor is held against its own kind. Limits are
fitted by ``sensor_limits`` to a stated rate of false alarms and used by ``sensor_tests``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.flag_runs import flag_runs
from flea_diag.core.frozen import Frozen
from flea_diag.core.running_mean import rolling_means
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.sensors.position_step import position_steps
from flea_diag.core.sensors.rest_watch import REST_S, STUCK_S, at_rest, long_runs
from flea_diag.core.sensors.sensor_set import SensorSet
from flea_diag.fields.values import AtLeastOne, Count, NotNegative

Array = npt.NDArray[np.float64]

NOISE_WINDOWS = (100, 400)  # assumption: a burst, and a lasting rise
UNIT_LOG = 0.3
"""Logarithm of the factor by which a healthy sensor of another unit may be noisier."""
QUIETER_LOG = 1.0
"""The same downwards: a sensor quieter than this no longer measures."""
STEP_GUARD = math.exp(UNIT_LOG)
"""Ratio of the limit of steps to the largest step to expect of the noise: where none is of the
motion it is of that, and a healthy sensor that is noisier steps by more."""
FEW = 0.01
"""Share of the scans whose steps are larger than the one that tells the scatter of all: few enough
to be of the tail, and many enough to be none of the motion's."""
SLOW_SHARE = 0.5
"""Where healthy motion seems to step by more of the way of a scan, starts and stops take no longer
than a scan: a step of the sensor shows beyond what a scan may go, and no sooner."""
LATE_SHARE = 0.1
"""No step is smaller than this share of the longest way of a scan: a reading that is taken so much
of a scan late shows it, however fine the sensor is."""
REACH_GUARD = 2.0  # assumption
REACH_QUANTILE = 0.999
"""Outliers of nominal recordings are no measure of what a sensor may do."""
DROPOUT_S = 20.0
"""Time over which drop-outs are counted; it takes two."""
SENSOR_SHARE = 0.1
"""Share of the rate of false alarms that all these tests together may use."""
LONGEST_REPEAT_S = 2.0
"""A reading that nominally stands still for longer than this is not tested for it."""
LONGEST_REPEATS = 20
"""The same of one that comes more seldom than scans, in its own readings."""
SELDOM = 0.05
"""Share of the times between changes that may be shorter than a reading takes to come: jitter."""


@dataclass(frozen=True, slots=True)
class SensorLimit(Frozen):
    """Nominal behaviour of one channel.

    ``quietest`` and ``loudest`` bound the logarithm of its noise level over the longest window
    of any nominal recording, ``scatter`` is that of a single sample of it, corrected for
    correlation: a mean of w has scatter / sqrt(w). ``repeats`` equal readings in a row are a
    reading that is held (0: not tested), ``reach`` is the largest step from one scan to the
    next, ``step`` the largest sudden step of a position (0: none). ``k`` is the limit in
    sigmas of the noise test. A reading comes with each of ``every`` scans, and is missing or held
    in between. ``rested``: whether the recordings show what it does at rest.
    """

    channel: str
    quietest: float
    loudest: float
    scatter: NotNegative
    repeats: Count
    reach: NotNegative
    step: NotNegative
    k: NotNegative
    every: AtLeastOne = 1
    rested: bool = True

    def has(self, test: str) -> bool:
        """Whether a residual of ``sensor_tests`` can be judged by this limit."""
        if test == self.channel:
            return self.step > 0.0
        channel, _, kind = test.rpartition("_")
        if not self.k:  # no noise of its own
            return test == f"{self.channel}_stuck" and self.repeats > 0
        return channel == self.channel and (kind == "noise" or self.repeats > 0)

    def shows_death(self, resolution: float) -> bool:
        """Whether a reading that stands still shows in a test of this sensor alone.

        Not where readings come much more seldom than scans and are held in between: a healthy one
        stands still as well, and its noise is that of its resolution.
        """
        return self.repeats > 0 or self.quietest - QUIETER_LOG > math.log(resolution)

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping of numbers and strings."""
        return asdict(self)


def noise_logs(values: Array, resolution: float | Array) -> Array:
    """Logarithm of the noise of each sample, shape (n - 3,) or (n - 3, channels).

    The third difference over sqrt(20) is blind to motion and has unit gain for white noise;
    means of its logarithm are moved by no outlier, and by a factor of the noise alike
    whatever the noise was.
    """
    third = values[3:] - 3.0 * values[2:-1] + 3.0 * values[1:-2] - values[:-3]
    logs: Array = np.log(np.maximum(np.abs(third) / math.sqrt(20.0), resolution))
    return logs


def sensor_limits(
    runs: Sequence[Mapping[str, Array]],
    sensors: SensorSet,
    false_alarms_per_hour: float,
    period_s: float,
) -> tuple[SensorLimit, ...]:
    """Limits of every one of the sensors, also of those held, that at least two recordings hold.

    ``runs``: readings of each channel of one recording, shape (scans,), NaN where none.
    """
    rate_per_s = SENSOR_SHARE * false_alarms_per_hour / 3600.0 / (3 * len(sensors.resolutions))
    found = []
    for channel in (*sensors.resolutions, *sensors.held):
        long = [
            run
            for run in runs
            if channel in run and np.isfinite(run[channel]).sum() > NOISE_WINDOWS[-1]
        ]
        if len(long) >= 2 and any(np.nanmax(r[channel]) > np.nanmin(r[channel]) for r in long):
            found.append(_limit(channel, sensors, long, rate_per_s, period_s))
    return tuple(found)


def _in_use(channel: str, sensors: SensorSet, run: Mapping[str, Array], scans: int) -> Array:
    """Readings of a channel without those in which it rightly stands still."""
    readings = run[channel]
    if channel == sensors.speed:
        readings = np.where(_rests(sensors, run, scans), np.nan, readings)
    return readings


def _rests(sensors: SensorSet, run: Mapping[str, Array], scans: int) -> npt.NDArray[np.bool_]:
    """Where the actuator rests, shape (scans,); nowhere without a position."""
    known = {name: rest for name, rest in sensors.positions.items() if name in run}
    rests = np.zeros(len(next(iter(run.values()))), dtype=bool)
    if known:
        positions = np.stack([run[name] for name in known], axis=1)
        rests[scans:] = at_rest(positions, np.array(list(known.values())), scans)
    return rests


def _limit(
    channel: str,
    sensors: SensorSet,
    runs: Sequence[Mapping[str, Array]],
    rate_per_s: float,
    period_s: float,
) -> SensorLimit:
    columns = [run[channel] for run in runs]
    came = [np.flatnonzero(np.isfinite(column)) for column in columns]
    readings = [column[at] for column, at in zip(columns, came, strict=True)]
    between, apart = _apart(readings, came)
    repeats, every = _repeats(channel, sensors, runs, rate_per_s, period_s), between
    if not repeats and apart > 1:
        repeats, every = _slow_repeats(readings, apart, rate_per_s, period_s), between * apart
    if channel in sensors.held:
        return SensorLimit(channel, 0.0, 0.0, 0.0, repeats, 0.0, 0.0, 0.0, every)
    quietest, loudest, scatter = _noise(columns, sensors.resolutions[channel])
    steps = [np.abs(np.diff(r)) / np.diff(at) for r, at in zip(readings, came, strict=True)]
    way = max(float(np.quantile(step, REACH_QUANTILE)) for step in steps)
    sudden = 0.0
    if channel in sensors.positions:
        sudden = _largest_step([r / between for r in readings], _quantile(rate_per_s * period_s))
    return SensorLimit(
        channel,
        quietest,
        loudest,
        scatter,
        repeats,
        REACH_GUARD * way,
        _step_limit(sudden, way),
        _quantile(rate_per_s * period_s * NOISE_WINDOWS[0]),
        every,
        _rested(channel, sensors, runs, period_s),
    )


def _apart(readings: Sequence[Array], came: Sequence[npt.NDArray[np.int64]]) -> tuple[int, int]:
    """Scans from one reading to the next, and readings from one to the next that may differ.

    ``came`` are the scans of the readings of each recording.

    A slow instrument is read faster than it measures: its readings change after a time that is
    always the same, or after some of them where it measures what it did before.
    """
    between = float(np.median(np.concatenate([np.diff(at) for at in came])))
    changes = [np.flatnonzero(np.diff(each)) for each in readings]
    apart = np.concatenate([np.diff(change) for change in changes])
    held = float(np.quantile(apart, SELDOM, method="lower")) if len(apart) else 1.0
    return max(1, round(between)), max(1, round(held))


def _rested(
    channel: str, sensors: SensorSet, runs: Sequence[Mapping[str, Array]], period_s: float
) -> bool:
    """Whether the recordings show the channel at rest; where no position is read none tells."""
    if not any(name in run for name in sensors.positions for run in runs):
        return True
    counts = ScanCounts(period_s)
    rests = [_rests(sensors, run, counts.of(REST_S)) for run in runs]
    known = [
        np.count_nonzero(long_runs(rest, counts.of(STUCK_S)) & np.isfinite(run[channel]))
        for run, rest in zip(runs, rests, strict=True)
    ]
    return int(sum(known)) >= NOISE_WINDOWS[-1]


def _largest_step(columns: Sequence[Array], rare: float) -> float:
    """The largest step to expect: of the recordings, or of their noise at the stated rate.

    ``rare``: what a standard normal variable exceeds so seldom. Steps of noise are estimated as the
    smallest of three that agree, and have no heavier a tail.
    """
    steps = np.concatenate([np.abs(position_steps(column)) for column in columns])
    steps = steps[np.isfinite(steps)]
    if not len(steps):
        return 0.0
    scatter = float(np.quantile(steps, 1.0 - FEW)) / _quantile(FEW)
    return max(float(steps.max()), rare * scatter)


def _step_limit(sudden: float, way: float) -> float:
    """Limit of steps, from the largest one and the longest way of a scan in nominal recordings."""
    if sudden == 0.0:
        return 0.0
    if sudden > SLOW_SHARE * way:
        return REACH_GUARD * way
    return max(STEP_GUARD * sudden, LATE_SHARE * way)


def _noise(columns: Sequence[Array], resolution: float) -> tuple[float, float, float]:
    """Range of the level over the longest window, and scatter of samples about their mean."""
    longest, shortest = NOISE_WINDOWS[-1], 50
    levels, scatters = [], []
    for column in columns:
        logs = noise_logs(column[np.isfinite(column)], resolution)
        levels.append(rolling_means(logs, longest))
        blocks = logs[: len(logs) // shortest * shortest].reshape(-1, shortest)
        # Half of the blocks lie within a quartile's range whatever else the motion does.
        low, high = np.quantile(np.diff(blocks.mean(axis=1)), (0.25, 0.75))
        scatters.append((high - low) / 1.349 / math.sqrt(2.0) * math.sqrt(shortest))
    everything = np.concatenate(levels)
    return float(everything.min()), float(everything.max()), max(float(np.mean(scatters)), 1e-6)


def _repeats(
    channel: str,
    sensors: SensorSet,
    runs: Sequence[Mapping[str, Array]],
    rate_per_s: float,
    period_s: float,
) -> int:
    """Equal readings in a row that come, twice in ``DROPOUT_S``, no oftener than the rate.

    With probability p that a reading repeats the one before, n repeats in a row come p^n times
    a scan. p is that of rest or that of motion: what rests repeats more than what moves, and may
    rest for as long as it likes. What nominal recordings show is exceeded in any case, but for one
    run of an encoder in each, which may hold its zero for a moment where it turns about.
    """
    counts = ScanCounts(period_s)
    scans = counts.of(REST_S)
    came = [np.isfinite(run[channel]) for run in runs]
    used = [_in_use(channel, sensors, run, scans) for run in runs]
    steps = [np.diff(readings[at]) for readings, at in zip(used, came, strict=True)]
    same = [step[np.isfinite(step)] == 0.0 for step in steps]
    rests = [_rests(sensors, run, scans)[at][1:] for run, at in zip(runs, came, strict=True)]
    every = np.concatenate(same)
    still = np.concatenate([r[np.isfinite(s)] for r, s in zip(rests, steps, strict=True)])
    # A drive that is off rightly holds its voltage; its command tells that from a fault.
    parts = () if channel in sensors.held else (every[still], every[~still])
    share = max(map(_share, (every, *parts)))
    if not share:
        return 0  # too little motion tells it
    single_per_scan = math.sqrt(rate_per_s * period_s / counts.of(DROPOUT_S))
    by_chance = math.ceil(math.log(single_per_scan) / math.log(share))
    longest = max(_longest(row, but=int(channel == sensors.speed)) for row in same)
    repeats = max(by_chance, longest + 1, 2)
    return repeats if repeats <= counts.of(LONGEST_REPEAT_S) else 0


def _slow_repeats(readings: Sequence[Array], apart: int, rate_per_s: float, period_s: float) -> int:
    """The same of an instrument that measures once in ``apart`` readings, as a number of readings.

    A run of them is a stuck one at the stated rate; it has no drop-outs, which are shorter.
    """
    same = []
    for each in readings:
        times = np.diff(np.flatnonzero(np.diff(each)))
        measured = np.maximum(np.rint(times / apart).astype(np.int64), 1)
        row = np.ones(int(measured.sum()), dtype=bool)
        row[np.cumsum(measured) - 1] = False
        same.append(row)
    share = _share(np.concatenate(same), NOISE_WINDOWS[0])
    if not share:
        return 0
    by_chance = math.ceil(math.log(rate_per_s * period_s * apart) / math.log(share))
    repeats = max(by_chance, 2 + max(_longest(row, but=0) for row in same))
    return repeats * apart if repeats <= LONGEST_REPEATS else 0


def _share(same: npt.NDArray[np.bool_], least: int = NOISE_WINDOWS[-1]) -> float:
    """Probability that a reading repeats the one before; 0 where fewer than ``least`` tell it."""
    return 0.0 if len(same) < least else float((1 + same.sum()) / (2 + len(same)))


def _longest(same: npt.NDArray[np.bool_], but: int) -> int:
    """Length of the longest run, ``but`` so many."""
    return int(np.sort(np.append(np.diff(flag_runs(same)), (0, 0)))[-1 - but])


def _quantile(alpha: float) -> float:
    from scipy.special import ndtri

    return float(-ndtri(min(alpha, 0.5) / 2.0))
