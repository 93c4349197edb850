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

"""Records: everything that processes exchange, as frozen values.

One dataclass per topic (see ``topics.TOPICS``). Times are integer nanoseconds since the Unix
epoch, at the acquisition of the data; values are SI (REP-103, temperatures in degC), NaN means
"not measured". Records compare by value and are safe to share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from flea_diag.wire.vocabulary import ANOTHER_UNIT as ANOTHER_UNIT
from flea_diag.wire.vocabulary import BY_DESIGN as BY_DESIGN
from flea_diag.wire.vocabulary import DRIVER_DEAD as DRIVER_DEAD
from flea_diag.wire.vocabulary import EARLIER_LEVEL as EARLIER_LEVEL
from flea_diag.wire.vocabulary import END_OF_TRAVEL as END_OF_TRAVEL
from flea_diag.wire.vocabulary import FREE_PER_RUN as FREE_PER_RUN
from flea_diag.wire.vocabulary import MODE as MODE
from flea_diag.wire.vocabulary import NEVER_NS as NEVER_NS
from flea_diag.wire.vocabulary import OFF_RATE as OFF_RATE
from flea_diag.wire.vocabulary import OTHER_UNIT as OTHER_UNIT
from flea_diag.wire.vocabulary import OUTCOME_LEVEL as OUTCOME_LEVEL
from flea_diag.wire.vocabulary import OUTSIDE_CALIBRATION as OUTSIDE_CALIBRATION
from flea_diag.wire.vocabulary import QUIET as QUIET
from flea_diag.wire.vocabulary import SECOND_NS as SECOND_NS
from flea_diag.wire.vocabulary import STARVING as STARVING
from flea_diag.wire.vocabulary import STREAM as STREAM
from flea_diag.wire.vocabulary import TAKEN_BACK as TAKEN_BACK
from flea_diag.wire.vocabulary import TAKEN_OVER as TAKEN_OVER
from flea_diag.wire.vocabulary import TOLD as TOLD
from flea_diag.wire.vocabulary import VIBRATION as VIBRATION
from flea_diag.wire.vocabulary import WIRING as WIRING
from flea_diag.wire.vocabulary import Cause as Cause
from flea_diag.wire.vocabulary import Level as Level
from flea_diag.wire.vocabulary import Outcome as Outcome
from flea_diag.wire.vocabulary import Quality as Quality
from flea_diag.wire.vocabulary import RemarkKind as RemarkKind

Verdict = tuple[object, ...]
"""Which verdict: source, stamps of detection and latest evidence, episode, step, outcome, names."""


@dataclass(frozen=True, slots=True)
class Scan:
    """All slow channels at one instant: ``values[k]`` belongs to ``channels[k]`` (SI)."""

    stamp_ns: int
    channels: tuple[str, ...]
    values: tuple[float, ...]

    def value(self, channel: str) -> float:
        """Value of one channel; NaN if the scan does not contain it."""
        try:
            return self.values[self.channels.index(channel)]
        except ValueError:
            return float("nan")


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """One row of the channel table: unit, range, rate and mounting of one channel."""

    name: str
    unit: str
    minimum: float
    maximum: float
    rate_hz: float
    serial: str = ""
    mount: str = ""
    sampling: str = "mean"
    note: str = ""


@dataclass(frozen=True, slots=True)
class ChannelTable:
    """Units, ranges, serials, rates and mounts of every channel of a stand."""

    stamp_ns: int
    stand: str
    channels: tuple[ChannelInfo, ...]

    def info(self, channel: str) -> ChannelInfo | None:
        """Row of one channel, or None."""
        return next((row for row in self.channels if row.name == channel), None)


@dataclass(frozen=True, slots=True)
class VibrationBlock:
    """20 to 100 ms of all accelerometer axes, packed as received.

    ``data`` holds ``count`` points, each a little-endian uint32 (ns after ``stamp_ns``)
    followed by one float32 (m/s^2) per axis. Nothing is decoded until ``points`` is called.
    """

    stamp_ns: int
    axes: tuple[str, ...]
    count: int
    data: bytes

    @staticmethod
    @cache
    def point_dtype(axes: int) -> np.dtype[np.void]:
        """Layout of one point with this number of axes."""
        return np.dtype([("t", "<u4"), ("a", "<f4", (axes,))])

    @classmethod
    def pack(
        cls,
        stamp_ns: int,
        axes: tuple[str, ...],
        offset_ns: npt.NDArray[np.integer],
        samples: npt.NDArray[np.floating],
    ) -> VibrationBlock:
        """Pack ``samples`` of shape (count, axes) taken ``offset_ns`` after the stamp."""
        points = np.empty(len(offset_ns), dtype=cls.point_dtype(len(axes)))
        points["t"] = offset_ns
        points["a"] = samples
        return cls(stamp_ns, axes, len(points), points.tobytes())

    def points(self) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
        """Decode: offsets in ns, shape (count,), and samples in m/s^2, shape (count, axes)."""
        points = np.frombuffer(self.data, dtype=self.point_dtype(len(self.axes)), count=self.count)
        return points["t"], points["a"]


@dataclass(frozen=True, slots=True)
class Residual:
    """Residuals of one scan: r in its unit, z = r over its nominal sigma, and limits of |z|.

    NaN where a residual cannot be formed (bad channel) or is gated (no excitation).
    ``regressors`` are the basis signals for the quantitative isolation (motor_current,
    direction, ...), by name. With a state observer, ``estimated`` names the channels that
    it predicts, ``estimates`` are the predictions from earlier scans and ``estimate_sigmas`` the
    standard deviations of a reading about them; ``health`` is the effective sample size (inf
    without particles), the normalised innovation squared per channel (expected value 1), and 1.0
    for a lost track.
    """

    stamp_ns: int
    names: tuple[str, ...]
    values: tuple[float, ...]
    z: tuple[float, ...]
    thresholds: tuple[float, ...]
    regressor_names: tuple[str, ...] = ()
    regressors: tuple[float, ...] = ()
    estimated: tuple[str, ...] = ()
    estimates: tuple[float, ...] = ()
    estimate_sigmas: tuple[float, ...] = ()
    health: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class VibrationLevel:
    """Vibration monitor: standard deviation (m/s^2) and kurtosis of one block, per axis.

    Older bags have no kurtosis.
    """

    stamp_ns: int
    axes: tuple[str, ...]
    std: tuple[float, ...]
    kurtosis: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class ChannelQuality:
    """State of one channel: quality, since when, reason, and error counters so far.

    ``read_ns`` is the stamp of its last reading, or of the last scan of a stream.
    """

    channel: str
    quality: Quality
    since_ns: int
    reason: str
    counters: tuple[tuple[str, int], ...] = ()
    read_ns: int = NEVER_NS


@dataclass(frozen=True, slots=True)
class UnitOffset:
    """Zero offset of one channel of this unit, learned in the warm-up, with its sigma (SI)."""

    parameter: str
    value: float
    sigma: float
    learned_ns: int


@dataclass(frozen=True, slots=True)
class JudgedTest:
    """In which share of the scans of the last 10 s and of the run one test judged, and why not.

    ``judged`` is false where it had next to nothing of what it should have judged.
    """

    residual: str
    recent: float
    run: float
    judged: bool = True
    cause: Cause = Cause.NONE
    why: str = ""


@dataclass(frozen=True, slots=True)
class DataQuality:
    """State of every channel and stream, the unit's offsets, and what was judged; on change."""

    stamp_ns: int
    channels: tuple[ChannelQuality, ...]
    offsets: tuple[UnitOffset, ...] = ()
    judged: tuple[JudgedTest, ...] = ()


@dataclass(frozen=True, slots=True)
class Detection:
    """Fault flag: raised by the first residual whose |z| exceeds its threshold.

    When it is cleared, ``test`` gives the reason: ``quiet``, ``reset``, ``ANOTHER_UNIT``,
    or ``TAKEN_BACK`` and why. ``onsets``: rank and stamp after which what is found by its evidence
    may have begun, the most likely first.
    """

    stamp_ns: int
    episode: int
    detected: bool
    residual: str
    z: float
    threshold: float
    test: str
    onsets: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Symbol:
    """Magnitude and slope of one residual as signs (+, -, 0; ``?`` = unknown, ``*`` = any)."""

    residual: str
    magnitude: str
    slope: str
    since_ns: int


@dataclass(frozen=True, slots=True)
class Symbols:
    """Symbols of all residuals in an episode, published on change."""

    stamp_ns: int
    episode: int
    symbols: tuple[Symbol, ...]


@dataclass(frozen=True, slots=True)
class Evidence:
    """One observation compared with its prediction: why a hypothesis was kept or dropped."""

    stamp_ns: int
    source: str
    observed: str
    predicted: str
    verdict: str
    path: str = ""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One fault of the catalogue with all evidence for and against it.

    In a summary the members beyond those that fit have a name only. ``size_sigma_own`` is the part
    of ``size_sigma`` that is not of the unit, which all its recordings share; NaN: not known.
    """

    fault: str
    hypothesis: str = ""
    probability: float = float("nan")
    reason: str = ""
    evidence: tuple[Evidence, ...] = ()
    size: float = float("nan")
    size_sigma: float = float("nan")
    size_unit: str = ""
    size_sigma_own: float = float("nan")


@dataclass(frozen=True, slots=True)
class NextTest:
    """Recommended test that would split the group; never a command to the stand.

    ``kind`` is ``feature`` or ``motion``; it is ``sensor`` where no test splits the group with
    the present sensors: ``what`` is then the sensor to fit and ``seconds`` is NaN. ``splits`` are
    the pairs of faults that the test separates.
    """

    kind: str
    what: str
    seconds: float = float("nan")
    expected_size: float = float("nan")
    splits: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TwoFaults:
    """Two faults of the catalogue at once; the first came first, where that is known."""

    first: str
    second: str
    probability: float = float("nan")


@dataclass(frozen=True, slots=True)
class Recurrence:
    """How a fault comes and goes: how often since when, for how long, and where.

    ``present_s`` is the time for which it was there, 0 where it never lasted for longer than
    ``shortest_s``, the shortest time that can be told; ``absent_s`` that for which it would have
    shown and did not, ``unseen_s`` that for which it could not have: with what it did then it has
    come ``most`` times at most. ``every_s`` is its rhythm and ``place`` where along the stroke it
    comes, in ``place_unit``; NaN: it has none.
    """

    count: int
    first_ns: int
    last_ns: int
    present_s: float
    absent_s: float
    shortest_s: float
    every_s: float = math.nan
    place: float = math.nan
    place_unit: str = "m"
    unseen_s: float = 0.0
    most: int = 0

    @property
    def duty(self) -> float:
        """Share of the time for which it was there."""
        whole_s = self.present_s + self.absent_s
        return self.present_s / whole_s if whole_s else math.nan


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """Everything that a verdict rests on: all evidence, all faults ruled out, and the advice."""

    stamp_ns: int
    outcome: Outcome
    episode: int
    step: int
    members: tuple[Candidate, ...]
    dropped: tuple[Candidate, ...]
    detected_stamp_ns: int
    words: str
    source: str
    not_observable: tuple[tuple[str, str], ...] = ()
    next_tests: tuple[NextTest, ...] = ()
    shows_from: tuple[tuple[str, str], ...] = ()
    looked_for: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The verdict that these hypotheses belong to."""
        return _verdict(self)


@dataclass(frozen=True, slots=True)
class AmbiguityGroup:
    """The verdict: possible faults, ranked, and faults ruled out, each with its reason.

    ``offsets`` are the unit offsets of the observer, from which a restarted observer resumes;
    ``stated_false_alarms_per_hour`` is the rate that the limits were set for and
    ``supported_false_alarms_per_hour`` the bound that the nominal recordings give;
    ``counters`` are the data errors so far, such as ``sensors/slow/lost``; ``shows_from`` is, for
    each fault, the size from which on half of the calibration's recordings would show it;
    ``looked_for`` are the faults of the catalogue that would have been found in the last 10 s.
    Where one fault explains too little, ``pairs`` are two at once, and the probability of a
    member is that of being one of both: they add up to 2. A
    ``summary`` names all members, gives the reason for the first of them, and counts what
    ``Hypotheses`` hold besides.
    ``to_do`` is what people do about the members, by the catalogue: ``run`` (stop or go on),
    ``urgency`` (now, soon or planned), ``name``, ``part``, ``procedure``, ``next_test``.
    ``comes_and_goes`` is how the members come and go; empty: they stay.
    """

    stamp_ns: int
    outcome: Outcome
    episode: int
    step: int
    seq: int
    members: tuple[Candidate, ...]
    dropped: tuple[Candidate, ...]
    detected_stamp_ns: int
    words: str
    calibration_sha256: str
    source: str
    not_observable: tuple[tuple[str, str], ...] = ()
    features_computed: tuple[str, ...] = ()
    features_available: int = 0
    stale: bool = False
    next_tests: tuple[NextTest, ...] = ()
    opened_by: str = ""
    offsets: tuple[UnitOffset, ...] = ()
    counters: tuple[tuple[str, int], ...] = ()
    summary: bool = False
    dropped_count: int = 0
    not_observable_count: int = 0
    stated_false_alarms_per_hour: float = math.nan
    supported_false_alarms_per_hour: float = math.nan
    to_do: tuple[tuple[str, str], ...] = ()
    shows_from: tuple[tuple[str, str], ...] = ()
    looked_for: tuple[str, ...] = ()
    pairs: tuple[TwoFaults, ...] = ()
    comes_and_goes: tuple[Recurrence, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Which verdict this is; repeated and stale ones are the same."""
        return _verdict(self)

    def hypotheses(self) -> Hypotheses:
        """What this verdict rests on, as a record of its own."""
        return Hypotheses(**{entry.name: getattr(self, entry.name) for entry in fields(Hypotheses)})

    def with_hypotheses(self, hypotheses: Hypotheses | None) -> AmbiguityGroup:
        """A summary completed by the hypotheses of the same verdict; else the group as it is."""
        if hypotheses is None or not self.summary or hypotheses.verdict != self.verdict:
            return self
        return replace(
            self,
            members=hypotheses.members,
            dropped=hypotheses.dropped,
            words=hypotheses.words if self.members else self.words,
            not_observable=hypotheses.not_observable,
            next_tests=hypotheses.next_tests,
            shows_from=hypotheses.shows_from,
            looked_for=hypotheses.looked_for,
            summary=False,
            dropped_count=0,
            not_observable_count=0,
        )


def _verdict(said: Hypotheses | AmbiguityGroup) -> Verdict:
    names = tuple(member.fault for member in said.members)
    times = said.detected_stamp_ns, said.stamp_ns
    return said.source, *times, said.episode, said.step, said.outcome, names


@dataclass(frozen=True, slots=True)
class SizeAt:
    """Size at one time, with the standard error of each by itself; unit of the size."""

    at_ns: int
    size: float
    sigma: float


@dataclass(frozen=True, slots=True)
class SizeTrend:
    """How a size of the fault of an episode has gone, and when it will reach its limit.

    ``level`` is that at the latest of ``sizes``, with ``level_sigma``, in which is what all of them
    share. ``direction`` is one of those of ``core/prognosis/trend.py``. ``limit`` is that of the
    catalogue, NaN without one; where growth is shown it is reached at ``median_ns``, with 90 %
    between ``low_ns`` and ``high_ns`` (NEVER_NS: never), has been with probability ``crossed`` and
    is never with probability ``never``.
    """

    stamp_ns: int
    episode: int
    fault: str
    quantity: str
    unit: str
    sizes: tuple[SizeAt, ...]
    level: float
    level_sigma: float
    direction: str
    slope_per_s: float = math.nan
    slope_sigma_per_s: float = math.nan
    limit: float = math.nan
    low_ns: int = NEVER_NS
    median_ns: int = NEVER_NS
    high_ns: int = NEVER_NS
    crossed: float = math.nan
    never: float = math.nan


@dataclass(frozen=True, slots=True)
class FeatureRequest:
    """Request for one feature of one window of the vibration stream."""

    stamp_ns: int
    episode: int
    step: int
    feature: str
    window_start_ns: int
    window_end_ns: int


@dataclass(frozen=True, slots=True)
class FeatureValue:
    """Answer to a request; if not computable, ``value`` is NaN and ``reason`` is given."""

    stamp_ns: int
    episode: int
    step: int
    feature: str
    window_start_ns: int
    window_end_ns: int
    value: float
    unit: str
    symbol: str
    nominal_low: float
    nominal_high: float
    reason: str
    cost_ms: float


@dataclass(frozen=True, slots=True)
class VerdictNumbers:
    """A verdict as numbers, for plots and for programs that read no text: ``values`` by name.

    ``verdict_numbers`` says which there are.
    """

    stamp_ns: int
    names: tuple[str, ...]
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Truth:
    """True fault of the stand, where the source knows it; no stage reads it."""

    stamp_ns: int
    fault: str
    onset_ns: int
    details: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Health:
    """One status on /diagnostics (REP-107): of a node, or of the stand in its words.

    ``hardware`` is the serial of what the status is on; empty: the actuator of the stand.
    """

    stamp_ns: int
    node: str
    level: Level
    message: str
    values: tuple[tuple[str, str], ...] = ()
    hardware: str = ""


@dataclass(frozen=True, slots=True)
class Remark:
    """Remark of an operator: a mark of a moment, or a comment or acknowledgement of an episode.

    The stamp of a mark is the marked moment, by the clock of the stand. A comment and an
    acknowledgement identify their episode by ``source`` and the stamp of its detection. A decision
    on the unit holds for the one that was told from the calibrated ones at ``detected_ns``. A
    shelved alarm does not ring until ``until_ns``.
    """

    stamp_ns: int
    kind: RemarkKind
    author: str
    text: str = ""
    source: str = ""
    detected_ns: int = NEVER_NS
    until_ns: int = NEVER_NS


Record = (
    Scan
    | ChannelTable
    | VibrationBlock
    | Residual
    | VibrationLevel
    | DataQuality
    | Detection
    | Symbols
    | Hypotheses
    | AmbiguityGroup
    | VerdictNumbers
    | SizeTrend
    | FeatureRequest
    | FeatureValue
    | Truth
    | Health
    | Remark
)
