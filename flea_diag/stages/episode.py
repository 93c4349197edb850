"""An episode: one period in which the stand deviates, as observer and isolator both know it.

The observer detects and owns the number of its Detection and Symbols. The isolator names faults
and counts its own episodes, for vibration opens some without any detection. What joins the two is
``detection_number``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from flea_diag.wire.records import EARLIER_LEVEL, TAKEN_OVER, Detection


@dataclass(frozen=True, slots=True)
class Episode:
    """How an episode began; the state that its owners keep beside it changes, this hardly does.

    Parameters
    ----------
    number : in the records of its owner
    detected_ns : stamp of the detection, or of the vibration alarm
    detection_number : the observer's number of it; of one that vibration opened without a
        detection, the newest that was known then
    opened_by : the test that passed its limit, with value and limit
    opening_shift : the residual that left its own level of this run; empty where none did
    opened_by_vibration : whether the vibration monitor opened it
    taken_over : whether the observer came back within it: then only a reset ends it
    """

    number: int
    detected_ns: int
    detection_number: int
    opened_by: str
    opening_shift: str = ""
    opened_by_vibration: bool = False
    taken_over: bool = False

    @classmethod
    def of(cls, detection: Detection, number: int) -> Episode:
        """The episode that a detection opens, under the number of its owner."""
        return cls(
            number,
            detection.stamp_ns,
            detection.episode,
            opening_cause(detection),
            opening_shift(detection),
            taken_over=detection.test == TAKEN_OVER,
        )

    def shifted_by(self, detection: Detection) -> Episode:
        """The same episode, in which the observer now detects as well."""
        return replace(self, opening_shift=opening_shift(detection))


def opening_shift(detection: Detection) -> str:
    """The residual that left its own level of this run, and no limit; empty where none did."""
    return detection.residual if detection.test.endswith(EARLIER_LEVEL) else ""


def opening_cause(detection: Detection) -> str:
    """The test that passed its limit, with value and limit."""
    if detection.test == TAKEN_OVER:
        return "episode open when the observer restarted"
    return (
        f"{detection.residual}: z = {detection.z:.4g}, limit {detection.threshold:.4g}, "
        f"{detection.test}"
    )
