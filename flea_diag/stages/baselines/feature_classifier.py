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

"""The feature-only baseline as a stage: all features of every second into a classifier, no model.

Scans and vibration in, Detection and AmbiguityGroup out. Several windows in motion in a row that
are called the same fault are a detection of it; what is called is the only member of the group.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

from flea_diag.core.choice.classifier import Perceptron
from flea_diag.core.vibration.features import all_ids, compute_all
from flea_diag.core.vibration.window import NotComputableError
from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.stages.extractor.windows import Windows
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import (
    SECOND_NS,
    Candidate,
    Detection,
    Outcome,
    Record,
    Scan,
    VibrationBlock,
)

NOMINAL = "nominal"
WINDOW_NS = SECOND_NS
IN_A_ROW = 3
"""Windows that must agree on a fault: of one alone, one in a hundred may be wrong."""
LEAST = 1e-12  # no probability is 0


class FeatureClassifierStage:
    """See the module's first lines. Latches on the first fault.

    Parameters
    ----------
    classifier
        From values of features to probabilities of faults and of ``nominal``.
    orders
        Ball-pass orders that features are computed with.
    """

    consumes: tuple[type, ...] = (VibrationBlock, Scan)

    def __init__(self, classifier: Perceptron, orders: Mapping[str, float]) -> None:
        self._classifier = classifier
        self._windows = Windows(4.0, 0.002, 0.05, orders)
        self._calls: deque[dict[str, float]] = deque(maxlen=IN_A_ROW)
        self._end_ns = -1
        self._began = self._latched = False

    def handle(self, record: Record) -> tuple[Record, ...]:
        """The verdict, where the window that this record completes changes it."""
        if self._latched or not isinstance(record, Scan | VibrationBlock):
            return ()
        if not self._windows.add(record):
            return ()
        if self._end_ns < 0:
            self._end_ns = record.stamp_ns + WINDOW_NS
        if not self._complete():
            return ()
        end_ns, self._end_ns = self._end_ns, self._end_ns + WINDOW_NS
        return self._judge(end_ns)

    def handle_block(self, block: ScanBlock) -> tuple[Record, ...]:
        """The same of many scans."""
        return tuple(caused for scan in block.records() for caused in self.handle(scan))

    def finish(self) -> tuple[Record, ...]:
        """What can be said of a run without one window of vibration in motion."""
        if self._began or self._latched:
            return ()
        words = "no vibration window in motion to classify"
        stamp_ns = max(self._windows.scans.end_ns, self._windows.vibration.end_ns)
        return (plain_verdict(stamp_ns, Outcome.NOT_OBSERVABLE, words),)

    def _complete(self) -> bool:
        """Whether both streams have reached the end of the window."""
        windows = self._windows
        there = min(windows.vibration.end_ns, windows.scans.end_ns) > 0
        return there and windows.covers(self._end_ns)

    def _judge(self, end_ns: int) -> tuple[Record, ...]:
        start_ns = end_ns - WINDOW_NS
        try:
            window = self._windows.cut(start_ns, end_ns)
        except NotComputableError:
            return ()
        if not self._windows.operating_point(start_ns, end_ns).moving:
            return ()
        values = compute_all(all_ids(window.axes), window)
        self._calls.append(self._classifier.probabilities(values))
        called = {max(call, key=call.__getitem__) for call in self._calls}
        if len(self._calls) == IN_A_ROW and len(called) == 1 and called != {NOMINAL}:
            return self._detect(end_ns, *called)
        if self._began:
            return ()
        self._began = True
        words = "no fault in three consecutive windows"
        features = self._classifier.features
        return (plain_verdict(end_ns, Outcome.NOMINAL, words, features=features),)

    def _detect(self, stamp_ns: int, fault: str) -> tuple[Record, ...]:
        self._latched = True
        odds = math.exp(math.fsum(math.log(max(c[fault], LEAST)) for c in self._calls) / IN_A_ROW)
        words = f"{IN_A_ROW} consecutive vibration windows classified as {fault}"
        member = Candidate(fault, "", odds, words)
        features = self._classifier.features
        return (
            Detection(stamp_ns, 1, True, "vibration", odds, LEAST, "classifier"),
            plain_verdict(stamp_ns, Outcome.ISOLATED, words, (member,), stamp_ns, features),
        )
