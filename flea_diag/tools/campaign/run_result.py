"""One line of an evaluation: what was wrong, what was said, when, and at what price.

A line is written once a run has ended and never changed. JSON knows no NaN, so what is not
known is null. Times are seconds after the first scan of the run, stamps are those of the
records.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.wire.records import BY_DESIGN

SCHEMA_VERSION = 1
KINDS = ("real", "simulated", "injected", "spliced")
"""Where the signals come from: recorded; simulated; recorded, with a software fault put in;
two recordings joined. Kinds are never added up in one figure."""

NOMINAL = "nominal"


@dataclass(frozen=True)
class RunResult:
    """One run of a campaign with one configuration.

    Parameters
    ----------
    id
        Name of the run in its campaign: equal runs of two evaluations have equal names.
    kind
        One of ``KINDS``.
    row
        Row of the table that the run counts in (``Current Bias``).
    configuration
        Name of the diagnoser's configuration or of the baseline.
    fold
        Which half calibrated (``A``, ``B``), empty where no split was made.
    truth, onset_s, size, size_unit
        What ``truth`` said; ``nominal`` has no onset.
    expected
        Faults that a right final group may hold, stated by the campaign; empty: no alarm.
    failure
        Why the run could not be diagnosed; empty when it could. All below is then empty.
    outcome, group, probabilities, words
        The final verdict: of the last episode, or of the end where there was none.
    detected_stamp_ns, isolated_stamp_ns
        Start of the last episode, and when its group took its final value.
    detection_time_s, isolation_time_s
        The same after the onset; None when the run is nominal or was not detected.
    detection_motion_s
        How much of the detection time the actuator moved.
    alarms_s
        Start of every episode.
    false_alarms
        Episodes that began before the onset, or in a nominal run.
    nominal_s
        Time before the onset, or the whole of a nominal run.
    features_computed, features_skipped
        Vibration features that were paid for, and how many of the table were not.
    cpu_s, peak_memory_bytes
        Processor time of the diagnosis alone; largest resident set of the process meanwhile.
    digest, decision_digest, backend
        What was decided, with and without the words; equal runs are equal on equal backends.
    detail
        File with the whole replay summary, relative to the evaluation's folder.
    date, commit
        Day and commit of the diagnosis; empty in lines of before there were such.
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
    probabilities: tuple[float, ...] = ()
    words: str = ""
    detected_stamp_ns: int | None = None
    isolated_stamp_ns: int | None = None
    detection_time_s: float | None = None
    isolation_time_s: float | None = None
    detection_motion_s: float | None = None
    alarms_s: tuple[float, ...] = ()
    false_alarms: int = 0
    nominal_s: float = 0.0
    duration_s: float = 0.0
    not_observable: tuple[str, ...] = ()
    features_computed: tuple[str, ...] = ()
    features_skipped: int = 0
    cpu_s: float = 0.0
    peak_memory_bytes: int = 0
    digest: str = ""
    decision_digest: str = ""
    backend: str = ""
    detail: str = ""
    date: str = ""
    commit: str = ""
    schema_version: int = SCHEMA_VERSION

    @property
    def key(self) -> tuple[str, str, str]:
        """What tells the lines of one evaluation apart."""
        return self.id, self.configuration, self.fold

    @property
    def faulty(self) -> bool:
        """Whether something was wrong."""
        return self.truth != NOMINAL

    @property
    def detected(self) -> bool:
        """Whether the fault was detected after its onset."""
        return self.detection_time_s is not None

    @property
    def right(self) -> bool:
        """Whether this is the answer that the campaign expects.

        No alarm where none is expected. Else: detected, no alarm before the onset, the truth
        in the final group, and nobody in it who is not expected.
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
    def by_design(self) -> bool:
        """Whether the group is too large, and the verdict says that it is the smallest there is.

        The truth is in it, and what the relations that were left could tell they told.
        """
        found = self.detected and not self.false_alarms and self.truth in self.group
        return found and not self.right and BY_DESIGN in self.words

    @property
    def unseen(self) -> bool:
        """Whether a fault that was to be found is one that the verdict says it cannot show."""
        silent = not self.alarms_s and not self.failure
        return silent and bool(self.expected) and self.truth in self.not_observable

    def to_line(self) -> str:
        """The result as one line of JSON."""
        return json.dumps(asdict(self), allow_nan=False, separators=(",", ":"))


_TUPLES = tuple(entry.name for entry in fields(RunResult) if str(entry.type).startswith("tuple"))


def from_mapping(content: Any, where: str) -> RunResult:
    """Result of what a line held.

    Raises
    ------
    RecordingError
        When it is no result of this version.
    """
    if not isinstance(content, dict) or content.get("schema_version") != SCHEMA_VERSION:
        raise RecordingError(f"{where}: no run result of version {SCHEMA_VERSION}: evaluate anew")
    known = {entry.name for entry in fields(RunResult)}
    odd = sorted(set(content) - known) or sorted({"id", "kind", "row"} - set(content))
    if odd:
        raise RecordingError(f"{where}: {odd[0]!r} is unknown or missing: evaluate anew")
    return RunResult(**{k: tuple(v) if k in _TUPLES else v for k, v in content.items()})
