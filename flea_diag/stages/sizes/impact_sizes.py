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

"""How strong the impacts of one recording are, at each ball-pass line: for faults like a spall.

Amplitudes of windows of ``WINDOW_S`` in motion. An impact is as strong as the parts meet fast, so
amplitudes are referred to one speed of the motor. How they go with the load is not known: trends
need recordings under like loads, so the load is told beside them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.faults.fault import Impacts
from flea_diag.core.likelihood.fault_models import Size
from flea_diag.core.likelihood.fit import SizeError
from flea_diag.core.vibration.nominal_range import SPEED_UNIT_RAD_S, VibrationOperatingPoint
from flea_diag.stages.extractor.extractor import ExtractorStage
from flea_diag.stages.sizes.recording_sizes import SETTLES_S, RecordingSize
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import (
    SECOND_NS,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Scan,
    VibrationBlock,
)

Array = npt.NDArray[np.float64]

LINES = ("nut", "screw", "ball")
"""Of the ball screw, whose raceways and balls pit; those that the kinematics of the stand give."""
WINDOW_S = 1.0
"""As that of features: some turns of the motor, within a stroke."""
LEAST_WINDOWS = 6
"""A scatter of fewer says little: 6 s in motion."""

TAKEN = (ChannelTable, Scan, ScanBlock, VibrationBlock)
"""Kinds of records that tell of impacts."""


class ImpactSizes:
    """Takes ``TAKEN`` of one recording after the other; ``sizes`` of the last begun."""

    def __init__(
        self, impacts: Impacts, table: FaultFeatureTable, orders: Mapping[str, float]
    ) -> None:
        self._impacts = impacts
        self._table = replace(table, nominal=replace(table.nominal, orders=orders))
        self._lines = [line for line in LINES if line in orders]
        self.begin()

    def begin(self) -> None:
        """Another recording."""
        self._extractor = ExtractorStage(self._table)
        self._amplitudes: dict[str, list[float]] = {line: [] for line in self._lines}
        self._points: list[VibrationOperatingPoint] = []
        self._next_ns, self._step = -1, 0
        self._why_none = f"no vibration of {self._impacts.accelerometer} was recorded"

    @property
    def lacks(self) -> str:
        """Why the recording has no size; empty: it has."""
        return "" if self._is_enough else self._why_none

    @property
    def _is_enough(self) -> bool:
        return bool(self._lines) and len(self._points) >= LEAST_WINDOWS

    @property
    def load_n(self) -> float:
        """Median load of the windows in motion; NaN where it is not measured."""
        loads = [point.load_n for point in self._points if math.isfinite(point.load_n)]
        return float(np.median(loads)) if loads else math.nan

    def add(self, record: ChannelTable | Scan | ScanBlock | VibrationBlock) -> None:
        """Scans and vibration in the order of their times."""
        if isinstance(record, ScanBlock):
            self._extractor.handle_block(record)
        else:
            self._extractor.handle(record)
        if isinstance(record, VibrationBlock) and self._next_ns < 0:
            self._why_none = "nothing moved for long enough"
            self._next_ns = record.stamp_ns + round(SETTLES_S * SECOND_NS)
        length_ns = round(WINDOW_S * SECOND_NS)
        while self._next_ns >= 0 and self._covers(self._next_ns + length_ns):
            self._measure(self._next_ns, self._next_ns + length_ns)
            self._next_ns += length_ns

    def _covers(self, end_ns: int) -> bool:
        """Whether scans have come as well: without them nothing is known of the motion."""
        windows = self._extractor.windows
        return windows.scans.end_ns >= end_ns and windows.covers(end_ns)

    def _measure(self, start_ns: int, end_ns: int) -> None:
        point = self._extractor.windows.operating_point(start_ns, end_ns)
        if not point.moving:
            return
        answers = {line: self._answer(line, start_ns, end_ns) for line in self._lines}
        why_not = next((a.reason for a in answers.values() if math.isnan(a.value)), "")
        if why_not:
            self._why_none = why_not
            return
        self._points.append(point)
        for line, answer in answers.items():
            self._amplitudes[line].append(answer.value)

    def _answer(self, line: str, start_ns: int, end_ns: int) -> FeatureValue:
        self._step += 1
        name = f"{self._impacts.accelerometer}_{line}_impacts"
        asked = FeatureRequest(end_ns, 0, self._step, name, start_ns, end_ns)
        (answer,) = self._extractor.handle(asked)
        assert isinstance(answer, FeatureValue)
        return answer

    def sizes(self) -> tuple[RecordingSize, ...]:
        """One for each line; none of a recording with too little motion or without vibration."""
        if not self._is_enough:
            return ()
        paces = np.array([point.speed_rad_s / SPEED_UNIT_RAD_S for point in self._points])
        found, load_n = [], self.load_n
        for line, amplitudes in self._amplitudes.items():
            size, own = _at_unit_speed(paces, np.array(amplitudes))
            of = Size(f"impacts at the {line} line", "m/s^2", 0.0, math.inf, self._impacts.limit)
            found.append(RecordingSize(of, size, SizeError(own, (0.0,)), load_n))
        return tuple(found)


def _at_unit_speed(paces: Array, amplitudes: Array) -> tuple[float, float]:
    """Amplitude at the reference speed and its standard error, by how windows scatter.

    ``paces``: speeds of the windows in units of that speed.
    """
    square = float(paces @ paces)
    size = float(paces @ amplitudes) / square
    left = paces * (amplitudes - size * paces)
    spread = len(paces) / (len(paces) - 1.0) * float(left @ left)
    return size, math.sqrt(spread) / square
