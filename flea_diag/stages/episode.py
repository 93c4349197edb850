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

"""An episode: one period of deviation, as shared by observer and isolator.

The observer owns the detection and numbers its Detection and Symbols. The isolator owns the
hypotheses and numbers its own episodes, as vibration may open one without a detection.
``detection_number`` joins the two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from flea_diag.wire.records import EARLIER_LEVEL, TAKEN_OVER, Detection


@dataclass(frozen=True, slots=True)
class Episode:
    """How an episode began.

    Parameters
    ----------
    number : as in the records of its owner
    detected_ns : stamp of the detection, or of the vibration alarm
    detection_number : number of the observer's episode; if vibration opened this one, the
        newest number received until then, later that of the detection that joins it
    opened_by : the test that passed its limit, with value and limit
    opening_shift : residual that left its earlier level in this run; empty if none did
    opened_by_vibration : whether the vibration monitor opened it
    taken_over : whether the observer was restarted within it: then only a reset ends it
    onsets_ns : stamps after which it may have begun, if it was found by its evidence
    """

    number: int
    detected_ns: int
    detection_number: int
    opened_by: str
    opening_shift: str = ""
    opened_by_vibration: bool = False
    taken_over: bool = False
    onsets_ns: tuple[int, ...] = ()

    @classmethod
    def of(cls, detection: Detection, number: int) -> Episode:
        """The episode opened by a detection, under the number of its owner."""
        return cls(
            number,
            detection.stamp_ns,
            detection.episode,
            opening_cause(detection),
            opening_shift(detection),
            taken_over=detection.test == TAKEN_OVER,
            onsets_ns=tuple(stamp_ns for _, stamp_ns in detection.onsets),
        )

    def vibrated_before(self, detection: Detection) -> bool:
        """Whether vibration opened this one before all began that the observer has detected."""
        first_ns = min((ns for _, ns in detection.onsets), default=self.detected_ns)
        return self.opened_by_vibration and first_ns > self.detected_ns

    def joined_by(self, detection: Detection) -> Episode:
        """The same episode, now detected by the observer as well."""
        return replace(
            self,
            detection_number=detection.episode,
            opening_shift=opening_shift(detection),
        )


def opening_shift(detection: Detection) -> str:
    """Residual that left its earlier level in this run; empty for other tests."""
    return detection.residual if detection.test.endswith(EARLIER_LEVEL) else ""


def opening_cause(detection: Detection) -> str:
    """The test above its limit, with value and limit."""
    if detection.test == TAKEN_OVER:
        return "episode open when the observer restarted"
    return (
        f"{detection.residual}: z = {detection.z:.4g}, limit {detection.threshold:.4g}, "
        f"{detection.test}"
    )
