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

"""One result of an evaluation: truth, verdict, times and cost.

A result is written when its run has ended and never changed. Unknown values are null. Times are
seconds after the first scan of the run; stamps are those of the records.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from flea_diag.errors import RecordingError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import FINITE, Share, within
from flea_diag.formats import FORMATS, migrated
from flea_diag.wire.records import BY_DESIGN

KINDS = ("real", "simulated", "injected", "spliced")
"""Where the signals come from: recorded; simulated; recorded with an injected software fault;
two recordings joined. Kinds are never added up in one figure."""

NOMINAL = "nominal"

MOST = 1e9
"""Largest count, and longest time in s, that a result may state."""


@dataclass(frozen=True)
class RunResult:
    """One run of a campaign with one configuration.

    Parameters
    ----------
    id
        Name of the run; equal runs of two evaluations have equal names.
    kind
        One of ``KINDS``.
    row
        Row of the table to which the run belongs (``Current Bias``).
    configuration
        Name of the diagnoser's configuration or of the baseline.
    fold
        Half that calibrated (``A``, ``B``); empty without cross-calibration.
    truth, onset_s, size, size_unit
        From the topic ``truth``; ``nominal`` has no onset.
    expected
        Faults that a right final group may hold, from the campaign; empty: no alarm.
    failure
        Why the run could not be diagnosed, else empty. With a failure all below is empty.
    outcome, group, probabilities, words
        Final verdict: of the last episode, or at the end of a run without episodes.
    detected_stamp_ns, isolated_stamp_ns
        Start of the last episode, and time of its final group.
    detection_time_s, isolation_time_s
        The same relative to the onset; None if nominal or not detected.
    detection_motion_s
        Part of the detection time in which the actuator moved.
    alarms_s
        Start of every episode.
    false_alarms
        Episodes that began before the onset, or in a nominal run.
    nominal_s
        Time before the onset, or the whole of a nominal run.
    features_computed, features_skipped
        Vibration features that were computed, and the number of those that were not.
    cpu_s, peak_memory_bytes
        Processor time of the diagnosis alone; peak resident memory of the process.
    digest, decision_digest, backend
        Digests of the decisions, with and without wording; reproducible on equal backends.
    detail
        File with the complete replay summary, relative to the evaluation's folder.
    date, commit
        Day and source commit of the diagnosis; empty in results of older versions.
    stand
        Name or folder of the stand; empty in results of older versions: the shipped FLEA.
    """

    id: str
    kind: str
    row: str
    configuration: str = "hybrid"
    fold: str = ""
    truth: str = NOMINAL
    onset_s: float | None = None
    size: float | None = None
    size_unit: str = ""
    expected: tuple[str, ...] = ()
    failure: str = ""
    outcome: str = ""
    group: tuple[str, ...] = ()
    probabilities: tuple[Share, ...] = ()
    words: str = ""
    detected_stamp_ns: int | None = None
    isolated_stamp_ns: int | None = None
    detection_time_s: float | None = None
    isolation_time_s: float | None = None
    detection_motion_s: float | None = None
    alarms_s: tuple[float, ...] = ()
    false_alarms: Annotated[int, within(0, MOST)] = 0
    nominal_s: Annotated[float, within(-MOST, MOST)] = 0.0
    duration_s: Annotated[float, within(0.0, MOST)] = 0.0
    not_observable: tuple[str, ...] = ()
    features_computed: tuple[str, ...] = ()
    features_skipped: Annotated[int, within(0, MOST)] = 0
    cpu_s: Annotated[float, within(0.0, MOST)] = 0.0
    peak_memory_bytes: Annotated[int, within(0, 1e15)] = 0
    digest: str = ""
    decision_digest: str = ""
    backend: str = ""
    detail: str = ""
    date: str = ""
    commit: str = ""
    stand: str = ""
    schema_version: int = FORMATS["run result"].version

    @property
    def key(self) -> tuple[str, str, str]:
        """Unique key of the result within its evaluation."""
        return self.id, self.configuration, self.fold

    @property
    def faulty(self) -> bool:
        """Whether the run has a fault."""
        return self.truth != NOMINAL

    @property
    def detected(self) -> bool:
        """Whether the fault was detected after its onset."""
        return self.detection_time_s is not None

    @property
    def right(self) -> bool:
        """Whether this is the answer that the campaign expects.

        No alarm if none is expected. Else: detected, no alarm before the onset, the truth in
        the final group, and no fault in it that is not expected.
        """
        if self.failure:
            return False
        if not self.expected:
            return not self.alarms_s and self.outcome == "NOMINAL"
        known = set(self.group)
        return (
            self.detected
            and not self.false_alarms
            and self.truth in known
            and known <= set(self.expected)
        )

    @property
    def misnamed(self) -> bool:
        """Whether a single fault is named that is not the one that is there."""
        return self.outcome == "ISOLATED" and self.truth not in self.group

    @property
    def by_design(self) -> bool:
        """Whether the group is too large and the verdict says that it cannot be split further.

        The truth is in the group, and the residuals that remained were evaluated.
        """
        found = self.detected and not self.false_alarms and self.truth in self.group
        return found and not self.right and BY_DESIGN in self.words

    @property
    def unseen(self) -> bool:
        """Whether the expected fault is not detected and the verdict lists it as not observable."""
        silent = not self.alarms_s and not self.failure
        return silent and bool(self.expected) and self.truth in self.not_observable

    def to_line(self) -> str:
        """The result as one line of JSON."""
        return json.dumps(asdict(self), allow_nan=False, separators=(",", ":"))


def from_mapping(content: Any, where: str) -> RunResult:
    """Result from the content of a line.

    Raises
    ------
    RecordingError
        The line is no result of this version; the field that is wrong is named.
    """
    known = migrated("run result", content, where)
    return read_as(RunResult, known, where, error=RecordingError, magnitudes=FINITE)
