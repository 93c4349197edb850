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

"""Feature samples from windows of recordings or of the simulated stand, labelled by the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flea_diag.core.choice.feature_learning import NOMINAL, Sample
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.core.smoothing import hann_kernels
from flea_diag.core.vibration.features import all_ids, compute_all
from flea_diag.core.vibration.features_motion import reverses
from flea_diag.core.vibration.level_learning import Levels
from flea_diag.core.vibration.nominal_range import FAST_RAD_S, NEAR_FASTEST, VibrationOperatingPoint
from flea_diag.core.vibration.window import NotComputableError
from flea_diag.stages.extractor.condition_indicators import condition_indicators
from flea_diag.stages.extractor.windows import Windows
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import NEVER_NS, SECOND_NS, Record, Scan, Truth, VibrationBlock

SETTLING_S = 0.3
"""Time skipped after the start and after an onset, for transients."""


@dataclass(frozen=True)
class Grid:
    """Grid of the windows: one of ``window_s`` every ``hop_s``."""

    window_s: float = 1.0
    hop_s: float = 1.0
    orders: Mapping[str, float] | None = None


@dataclass(frozen=True)
class FeatureRun:
    """Samples of one recording, and the vibration monitor's indicators of its nominal blocks.

    ``levels`` is the standard deviation of each axis, ``kurtosis`` its kurtosis.
    """

    name: str
    rate_hz: float
    samples: tuple[Sample, ...]
    levels: Levels = ()
    kurtosis: Levels = ()

    @property
    def typical(self) -> tuple[Sample, ...]:
        """Samples of windows fit for feature requests: fast, or near the run's highest speed."""
        moving = [sample for sample in self.samples if sample.moving]
        fastest = max((sample.point.speed_rad_s for sample in moving), default=0.0)
        least = min(FAST_RAD_S, NEAR_FASTEST * fastest)
        return tuple(sample for sample in moving if sample.point.speed_rad_s >= least)

    def asked(self, group: Sequence[str], windows: int) -> list[Sample]:
        """The first windows with a fault of the group on which features would be requested.

        Windows with a reversal come first.
        """
        fitting = [sample for sample in self.typical if sample.fault in group]
        return sorted(fitting, key=lambda sample: not sample.reverses)[:windows]


def run_of_bag(directory: Path, grid: Grid) -> FeatureRun:
    """Samples of one bag.

    Raises
    ------
    RecordingError
        There is no bag, or it cannot be read.
    """
    truths = [record for _, record in read_bag(directory, (Truth,)) if isinstance(record, Truth)]
    stream = (record for _, record in read_bag(directory, (Scan, VibrationBlock)))
    return run_of(str(directory), stream, truths, grid)


def run_of(name: str, stream: Iterable[Record], truths: list[Truth], grid: Grid) -> FeatureRun:
    """Samples of a stream of scans and blocks, in order of arrival."""
    windows = Windows(grid.window_s + 3.0, 0.002, 0.05, grid.orders or {})
    samples: list[Sample] = []
    heard: list[_BlockIndicators] = []
    scans: list[tuple[int, float, float]] = []
    end_ns = -1
    for record in stream:
        if not isinstance(record, Scan | VibrationBlock) or not windows.add(record):
            continue
        if isinstance(record, Scan):
            motion = record.value("motor_speed"), record.value("load_force")
            scans.append((record.stamp_ns, *motion))
        if end_ns < 0:
            end_ns = record.stamp_ns + round((grid.window_s + SETTLING_S) * SECOND_NS)
        while min(windows.vibration.end_ns, windows.scans.end_ns) > 0 and windows.covers(end_ns):
            start_ns = end_ns - round(grid.window_s * SECOND_NS)
            fault = label(truths, start_ns, end_ns)
            if fault is not None:
                samples += _samples(windows, start_ns, end_ns, fault)
            if fault == NOMINAL:
                heard += _heard(windows, start_ns, end_ns)
            end_ns += round(grid.hop_s * SECOND_NS)
    pointed = list(_pointed(heard, scans))
    levels, kurtosis = ([(point, row[k]) for point, row in pointed] for k in range(2))
    return FeatureRun(name, windows.vibration.rate_hz, tuple(samples), levels, kurtosis)


def label(truths: Iterable[Truth], start_ns: int, end_ns: int) -> str | None:
    """Fault present throughout a window; None if its onset or growth lies within the window."""
    found = NOMINAL
    for truth in sorted(truths, key=lambda row: row.stamp_ns):
        if truth.onset_ns == NEVER_NS:
            if truth.stamp_ns <= start_ns:
                found = NOMINAL
            elif truth.stamp_ns < end_ns:
                return None
            continue
        growth_s = float(dict(truth.details).get("growth_s", "0"))
        full_ns = truth.onset_ns + round((growth_s + SETTLING_S) * SECOND_NS)
        if truth.onset_ns < end_ns and full_ns > start_ns:
            return None
        if full_ns <= start_ns:
            found = truth.fault
    return found


def _samples(windows: Windows, start_ns: int, end_ns: int, fault: str) -> Iterator[Sample]:
    try:
        window = windows.cut(start_ns, end_ns)
    except NotComputableError:
        return
    point = windows.operating_point(start_ns, end_ns)
    turns = reverses(window.slow.get("motor_speed", ()), window.slow.get("load_force", ()))
    yield Sample(fault, point, compute_all(all_ids(window.axes), window), turns)


@dataclass(frozen=True)
class _BlockIndicators:
    """Condition indicators of one vibration block, by axis."""

    start_ns: int
    end_ns: int
    indicators: tuple[Mapping[str, float], ...]


def _heard(windows: Windows, start_ns: int, end_ns: int) -> Iterator[_BlockIndicators]:
    """Indicators of the blocks within a window, as received by the vibration monitor."""
    for block, block_end_ns in windows.vibration.blocks(start_ns, end_ns):
        found = condition_indicators(block)
        by_axis = (dict(zip(block.axes, values, strict=True)) for values in found)
        yield _BlockIndicators(block.stamp_ns, block_end_ns, tuple(by_axis))


def _pointed(
    heard: Iterable[_BlockIndicators], scans: Sequence[tuple[int, float, float]]
) -> Iterator[tuple[VibrationOperatingPoint, tuple[Mapping[str, float], ...]]]:
    """Indicators with the operating point of the vibration monitor: smoothed speed and load.

    A load actuator that slips and sticks again causes steps within a few scans, in which smoothed
    and raw speed differ by a large factor.
    """
    if len(scans) < 2:
        return
    stamps_ns = np.array([stamp_ns for stamp_ns, _, _ in scans])
    length = ScanCounts(float(np.median(np.diff(stamps_ns))) * 1e-9).kernel
    if len(scans) < length:
        return
    kernel, edge = hann_kernels(length, 1.0)[0], length // 2
    stamps_ns = stamps_ns[edge:-edge]
    motion = np.array([row[1:] for row in scans])
    smooth = np.column_stack([np.convolve(column, kernel, "valid") for column in motion.T])
    for block in heard:
        inside = smooth[(stamps_ns >= block.start_ns) & (stamps_ns <= block.end_ns)]
        if len(inside):
            speed, load = np.sqrt(np.mean(inside**2, axis=0)).tolist()
            yield VibrationOperatingPoint(speed, load), block.indicators
