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

"""The words that records are written in; everybody imports them from ``records``."""

from __future__ import annotations

from enum import Enum, IntEnum

SECOND_NS = 1_000_000_000
NEVER_NS = -1
"""Stamp of an event that has not happened."""
BY_DESIGN = "by design"
"""Of a verdict on several faults: these sensors cannot split them, whatever else is seen."""
TAKEN_OVER = "taken over"
"""``test`` of a Detection that an observer which has come back took from the verdict."""
ANOTHER_UNIT = "another unit"
"""What ends a Detection when the stand has gone over to another unit: a new one begins."""
QUIET = "quiet"
"""Why an episode is closed: no test has been near its limit for long enough."""
TAKEN_BACK = "taken back"
"""Begins the ``test`` of a Detection cleared because all that its episode rests on is void."""
EARLIER_LEVEL = "its earlier level"
"""Ends the ``test`` of a Detection that held a residual against the same run before it."""
STREAM = "sensors/slow"
"""The stream of scans, as ``data_quality`` counts it beside the channels."""
END_OF_TRAVEL = "end_of_travel"
"""Row of ``data_quality`` while the actuator is at an end of its travel, and what follows."""
OUTSIDE_CALIBRATION = "outside_calibration"
"""Row of ``data_quality`` while the motion is far outside what the calibration has seen."""
MODE = "mode"
"""Row of ``data_quality`` of a machine whose modes a channel tells: which hold, what follows."""
FREE_PER_RUN = "free_per_run"
"""Row of ``data_quality`` of a run that has values of its own, such as another payload."""
TOLD = (MODE, FREE_PER_RUN)
"""Rows of ``data_quality`` that say something of a machine that is well."""
OTHER_UNIT = "unit"
"""Row of ``data_quality`` of a unit that is none of the calibration's, with what differs: saturated
beyond what healthy units differ by, else good."""
WIRING = "wiring"
"""Row of ``data_quality`` where the relations contradict how a channel is wired, with what is
wrong: bad where nothing else explains the readings as well, saturated where a fault of the machine
may; good while it is looked at."""
VIBRATION = "vibration"
"""Row of ``data_quality`` where no nominal range can judge an accelerometer."""
STARVING = "starved: more than half of the scans lost or too late"
"""Reason of a stream that has too few scans left to test."""
OFF_RATE = "scans come at "
"""Begins the reason of a stream whose scans come at another rate than that of the calibration."""
DRIVER_DEAD = "DAQ frozen: scans arrive, values do not change or are missing"
"""Reason of a stream on which no channel delivers new values any more."""


class Outcome(str, Enum):
    """What the diagnoser concludes (one enum everywhere)."""

    NOMINAL = "NOMINAL"
    DETECTED = "DETECTED"
    ISOLATED = "ISOLATED"
    INDISTINGUISHABLE = "INDISTINGUISHABLE"
    UNEXPLAINED = "UNEXPLAINED"
    NOT_OBSERVABLE = "NOT_OBSERVABLE"
    MODEL_MISMATCH = "MODEL_MISMATCH"
    DATA_UNUSABLE = "DATA_UNUSABLE"


class Level(IntEnum):
    """Severity as diagnostic_msgs/DiagnosticStatus counts it."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


OUTCOME_LEVEL: dict[Outcome, Level] = {
    Outcome.NOMINAL: Level.OK,
    Outcome.DETECTED: Level.WARN,
    Outcome.NOT_OBSERVABLE: Level.WARN,
    Outcome.MODEL_MISMATCH: Level.WARN,
    Outcome.DATA_UNUSABLE: Level.WARN,
    Outcome.ISOLATED: Level.ERROR,
    Outcome.INDISTINGUISHABLE: Level.ERROR,
    Outcome.UNEXPLAINED: Level.ERROR,
}


class RemarkKind(str, Enum):
    """What somebody at the stand did with words or without."""

    MARK = "mark"
    COMMENT = "comment"
    ACKNOWLEDGED = "acknowledged"
    UNIT_ACCEPTED = "unit accepted"
    UNIT_REJECTED = "unit rejected"
    WITHDRAWN = "acknowledgement withdrawn"
    SHELVED = "shelved"
    UNSHELVED = "unshelved"
    OUT_OF_SERVICE = "out of service"
    IN_SERVICE = "in service"

    @property
    def is_on_unit(self) -> bool:
        """Whether it decides that the unit on the stand is healthy, or takes that back."""
        return self in (RemarkKind.UNIT_ACCEPTED, RemarkKind.UNIT_REJECTED)

    @property
    def is_on_service(self) -> bool:
        """Whether it takes the alarms of the whole stand out of service, or puts them back."""
        return self in (RemarkKind.OUT_OF_SERVICE, RemarkKind.IN_SERVICE)


class Quality(str, Enum):
    """State of one channel."""

    GOOD = "good"
    BAD = "bad"
    STALE = "stale"
    SATURATED = "saturated"
    ABSENT = "absent"


class Cause(str, Enum):
    """Why a test has not judged every scan."""

    NONE = ""
    AT_REST = "at rest"
    MISSING = "missing"
    GAP = "gap"
    VOID = "void"
    OUTSIDE = "outside"
    UNFORMED = "not formed"

    @property
    def is_of_the_data(self) -> bool:
        """Whether the readings are to blame, rather than the motion or the place."""
        return self in (Cause.MISSING, Cause.GAP, Cause.UNFORMED)
