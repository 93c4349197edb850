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

"""Features on request: one feature, one window, one answer; and the levels of every block.

The stamp of an answer is that of its request plus the answer budget, independent of computation
time: records merged by stamp have the same order live and in replay.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.vibration.features import FeatureId, Scope, evaluate
from flea_diag.core.vibration.nominal_range import RATE_TOLERANCE, VibrationOperatingPoint
from flea_diag.core.vibration.window import NotComputableError, Window
from flea_diag.errors import ConfigurationError
from flea_diag.stages.extractor.condition_indicators import condition_indicators
from flea_diag.stages.extractor.windows import Windows
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    SECOND_NS,
    ChannelTable,
    FeatureRequest,
    FeatureValue,
    Record,
    Scan,
    VibrationBlock,
    VibrationLevel,
)


@dataclass(frozen=True)
class ExtractorParameters:
    """Parameters that a user may set on the extractor."""

    history_s: float = parameter(
        10.0, "vibration and scans kept for requests", unit="s", minimum=0.5, maximum=60.0
    )
    answer_budget_s: float = parameter(
        0.15, "stamp of an answer after that of its request", unit="s", minimum=0.0, maximum=5.0
    )
    shortest_window_s: float = parameter(
        0.05, "windows shorter than this are refused", unit="s", minimum=0.001, maximum=10.0
    )
    gap_limit_s: float = parameter(
        0.002, "longest break between blocks inside a window", unit="s", minimum=0.0, maximum=1.0
    )
    scan_gap_limit_s: float = parameter(
        0.05, "longest break between scans inside a window", unit="s", minimum=0.0, maximum=1.0
    )
    rate_tolerance: float = parameter(
        RATE_TOLERANCE,
        "largest relative error of the sampling rate",
        unit="1",
        minimum=0.0,
        maximum=0.5,
    )
    full_scale_m_s2: float = parameter(
        0.0,
        "range of the accelerometers where the channel table names none; 0: unlimited",
        unit="m/s^2",
        minimum=0.0,
        maximum=1e6,
    )
    saturated_points: int = parameter(
        3, "points at full scale that spoil a window", unit="1", minimum=1, maximum=1_000_000
    )
    most_pending: int = parameter(
        32, "requests kept until their window is complete", unit="1", minimum=1, maximum=10_000
    )
    sentinel: bool = parameter(
        True, "publish level and kurtosis of every vibration block on vibration_level"
    )


@dataclass(frozen=True)
class _Cut:
    """A requested window: its operating point, and its decoded parts.

    ``windows``: by accelerometer; ``moved``: those that include the motion.
    """

    start_ns: int
    end_ns: int
    point: VibrationOperatingPoint
    windows: dict[str, Window] = field(default_factory=dict)
    moved: set[str] = field(default_factory=set)


class ExtractorStage:
    """Keeps the raw blocks of the last seconds and computes single features on request.

    Parameters
    ----------
    table : nominal ranges and ball-pass orders to compare values with
    stopwatch : nanoseconds of any clock, used only for ``cost_ms``; a stage owns no clock
    """

    consumes: tuple[type, ...] = (ChannelTable, VibrationBlock, Scan, FeatureRequest)

    def __init__(
        self,
        table: FaultFeatureTable,
        parameters: ExtractorParameters | None = None,
        stopwatch: Callable[[], int] = lambda: 0,
    ) -> None:
        self.table = table
        self.parameters = p = parameters or ExtractorParameters()
        self.windows = Windows(p.history_s, p.gap_limit_s, p.scan_gap_limit_s, table.nominal.orders)
        self._keep_scan = self.windows.scans.add
        self.duplicates = 0
        self._cut = _Cut(0, 0, VibrationOperatingPoint())
        self._stopwatch = stopwatch
        self._full_scale: dict[str, float] = {}
        self._pending: deque[FeatureRequest] = deque()
        self._now_ns = 0
        self._seen: deque[tuple[int, int, int]] = deque(maxlen=1024)

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Answers and levels that a record causes."""
        levels: tuple[Record, ...] = ()
        if isinstance(record, Scan):
            self._keep_scan(record)
            self._now_ns = record.stamp_ns
            if not self._pending:
                return ()
        elif isinstance(record, VibrationBlock):
            levels = self._level(record)
        elif isinstance(record, FeatureRequest):
            self._accept(record)
        elif isinstance(record, ChannelTable):
            self._full_scale = {
                row.name: min(abs(row.minimum), abs(row.maximum)) for row in record.channels
            }
            return ()
        if not self._pending:
            return levels
        # A request may arrive after the last scan: it cannot wait for another.
        return (*levels, *self._answers(max(record.stamp_ns, self._now_ns)))

    @property
    def takes_blocks(self) -> bool:
        """Whether no request waits for scans that are still to come."""
        return not self._pending

    def handle_block(self, block: ScanBlock) -> tuple[int, tuple[Record, ...]]:
        """Store these scans."""
        self.windows.scans.add_block(block)
        self._now_ns = int(block.stamps_ns[-1])
        return len(block), ()

    def _level(self, block: VibrationBlock) -> tuple[Record, ...]:
        """Store a block; its levels are stamped with the end of the block."""
        kept = self.windows.vibration.add(block)
        if kept is None or not self.parameters.sentinel:
            return ()
        if not self._is_rate_known(kept.rate_hz):
            return ()  # the ranges were learned at another sampling rate
        std, kurtosis = condition_indicators(block)
        return (VibrationLevel(kept.end_ns, block.axes, std, kurtosis),)

    def _accept(self, request: FeatureRequest) -> None:
        key = (request.stamp_ns, request.episode, request.step)
        if key in self._seen:
            self.duplicates += 1
            return
        self._seen.append(key)
        self._pending.append(request)

    def _answers(self, now_ns: int) -> tuple[Record, ...]:
        """Answer, in order of the requests, those that are complete or due."""
        answers: list[Record] = []
        for _ in range(len(self._pending)):
            request = self._pending.popleft()
            full = len(self._pending) >= self.parameters.most_pending
            if full or self._is_ready(request, now_ns):
                answers.append(self._answer(request))
            else:
                self._pending.append(request)
        return tuple(answers)

    def _is_ready(self, request: FeatureRequest, now_ns: int) -> bool:
        """Whether the window is covered or the answer is due."""
        late = now_ns >= request.stamp_ns + self._budget_ns
        return late or self.windows.covers(request.window_end_ns)

    @property
    def _budget_ns(self) -> int:
        return round(self.parameters.answer_budget_s * SECOND_NS)

    def _answer(self, request: FeatureRequest) -> FeatureValue:
        """Value, symbol and nominal range, or NaN with the reason."""
        begun = self._stopwatch()
        value, unit, reason = math.nan, "", ""
        point = self._cut_of(request).point
        try:
            wanted = FeatureId.parse(request.feature)
            unit = wanted.feature.unit
            value = evaluate(wanted, self._window(request, wanted))
        except (NotComputableError, ConfigurationError) as error:
            reason = str(error)
        low, high = self.table.nominal.at(request.feature, point)
        symbol = self.table.nominal.symbol(request.feature, value, point)
        if symbol == "?" and not reason:
            reason = self._why_no_range(request.feature)
        return FeatureValue(
            request.stamp_ns + self._budget_ns,
            request.episode,
            request.step,
            request.feature,
            request.window_start_ns,
            request.window_end_ns,
            value,
            unit,
            symbol,
            low,
            high,
            reason,
            (self._stopwatch() - begun) / 1e6,
        )

    def _why_no_range(self, feature: str) -> str:
        if feature not in self.table.nominal.ranges:
            return f"{self.table.title!r} has no nominal range of {feature}"
        return "motor_speed is not measured in the window: nominal range unknown"

    def _window(self, request: FeatureRequest, wanted: FeatureId) -> Window:
        """Decode only what one feature needs; later features share it."""
        start_ns, end_ns = request.window_start_ns, request.window_end_ns
        shortest_s = self.parameters.shortest_window_s
        if end_ns - start_ns < shortest_s * SECOND_NS:
            raise NotComputableError(
                f"window of {(end_ns - start_ns) / 1e9:.3f} s is shorter than {shortest_s:g} s"
            )
        if wanted.feature.scope is Scope.SCANS:
            return self.windows.motion(start_ns, end_ns)
        cut, name = self._cut_of(request), wanted.accelerometer
        if name not in cut.windows:
            window = self.windows.cut(start_ns, end_ns, name, with_motion=False)
            self._check_rate(window.rate_hz)
            self._check_saturation(window)
            cut.windows[name] = window
        if wanted.feature.needs_scans and name not in cut.moved:
            cut.windows[name] = self.windows.moved(cut.windows[name], start_ns, end_ns)
            cut.moved.add(name)
        return cut.windows[name]

    def _cut_of(self, request: FeatureRequest) -> _Cut:
        """The decoded window of a request; reused if the last request had the same window."""
        start_ns, end_ns = request.window_start_ns, request.window_end_ns
        if (self._cut.start_ns, self._cut.end_ns) != (start_ns, end_ns):
            point = self.windows.operating_point(start_ns, end_ns)
            self._cut = _Cut(start_ns, end_ns, point)
        return self._cut

    def _is_rate_known(self, rate_hz: float) -> bool:
        return self.table.nominal.holds_at(rate_hz, self.parameters.rate_tolerance)

    def _check_rate(self, rate_hz: float) -> None:
        learned_hz = self.table.nominal.rate_hz
        if not self._is_rate_known(rate_hz):
            raise NotComputableError(
                f"vibration is sampled at {rate_hz:.6g} Hz, "
                f"nominal ranges were learned at {learned_hz:.6g} Hz"
            )

    def _check_saturation(self, window: Window) -> None:
        for axis, column in zip(window.axes, window.samples.T, strict=True):
            limit = self._full_scale.get(axis) or self.parameters.full_scale_m_s2
            if not 0.0 < limit < math.inf:
                continue
            end = 0.999 * limit
            if -end < column.min() and column.max() < end:
                continue
            count = int(np.count_nonzero(np.abs(column) >= end))
            if count >= self.parameters.saturated_points:
                raise NotComputableError(
                    f"{axis} is saturated: {count} points at its full scale of {limit:g} m/s^2"
                )
