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

"""Everything a screen shows, folded from records: ``state = fold(state, record, arrived_ns)``.

Frozen and bounded: the size does not grow with time. A screen that joins late starts from the
latched topics (verdict, hypotheses, detection, data quality, channels, truth); other topics are
shown from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from flea_diag.operator import alarm as alarms_of
from flea_diag.operator.alarm import Alarm, AlarmAction, Comment, Key
from flea_diag.operator.shift.alarm_rate import of_shift
from flea_diag.operator.stream import (
    StreamState,
    counted,
    jumped_back,
    scan_period_ns,
    streams,
)
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Health,
    Hypotheses,
    Outcome,
    Record,
    RemarkKind,
    Residual,
    Scan,
    SizeTrend,
    Symbol,
    Symbols,
    Truth,
    VibrationLevel,
)
from flea_diag.wire.topics import TOPIC_OF

MOST_STEPS = 200
MOST_SYMBOLS = 400
MOST_FEATURES = 64
MOST_ALARMS = 100
MOST_TIMES = 5000
"""Alarms of a shift that are counted, whether they are still shown or not."""
MOST_NODES = 64
ALONE_NS = 2_000_000_000
"""Time after which a detection without a verdict becomes an alarm by itself."""

OPEN = (Outcome.DETECTED, Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, Outcome.UNEXPLAINED)
"""Outcomes whose members are possible faults."""


@dataclass(frozen=True, slots=True)
class GroupStep:
    """One change of the group: the remaining faults, and those dropped with the reason."""

    stamp_ns: int
    detected_ns: int
    episode: int
    outcome: Outcome
    faults: tuple[str, ...]
    dropped: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class SymbolChange:
    """Symbol of one residual from ``stamp_ns`` on."""

    stamp_ns: int
    episode: int
    symbol: Symbol


@dataclass(frozen=True, slots=True)
class AskedFeature:
    """A requested feature; ``value`` is None until it is answered."""

    episode: int
    step: int
    name: str
    asked_ns: int
    value: FeatureValue | None = None


@dataclass(frozen=True, slots=True)
class OperatorState:
    """The latest record of each type, and a bounded history of slow changes.

    ``steps``, ``symbols`` and ``features`` are in order of time, across episodes; ``alarms`` are
    in order of detection, ``marks`` in order of the marked moments. ``streams`` are keyed by
    topic, ``health`` by node. ``alarm_times`` are the stamps of all alarms of the last shift, also
    of those that are no longer kept; ``waiting`` is how many of the journal nobody has
    acknowledged.
    """

    group: AmbiguityGroup | None = None
    hypotheses: Hypotheses | None = None
    detection: Detection | None = None
    quality: DataQuality | None = None
    channels: ChannelTable | None = None
    truth: Truth | None = None
    scan: Scan | None = None
    residual: Residual | None = None
    level: VibrationLevel | None = None
    trend: SizeTrend | None = None
    steps: tuple[GroupStep, ...] = ()
    symbols: tuple[SymbolChange, ...] = ()
    features: tuple[AskedFeature, ...] = ()
    alarms: tuple[Alarm, ...] = ()
    alarm_times: tuple[int, ...] = ()
    waiting: int = 0
    marks: tuple[Comment, ...] = ()
    service: AlarmAction | None = None
    streams: Mapping[str, StreamState] = field(default_factory=streams)
    health: Mapping[str, Health] = field(default_factory=dict)
    detection_arrived_ns: int = NEVER_NS

    def stream(self, record_type: type) -> StreamState:
        """Counters of the topic of a record type."""
        return self.streams[TOPIC_OF[record_type].name.lstrip("/")]

    @property
    def beyond(self) -> int:
        """Alarms that nobody has acknowledged and that are kept in the journal alone."""
        kept = sum(alarm.standing and alarm.source != alarms_of.REPLAY for alarm in self.alarms)
        return max(self.waiting - kept, 0)

    @property
    def ringing(self) -> int:
        """Number of alarms that ring."""
        out = self.service is not None and self.service.kind is RemarkKind.OUT_OF_SERVICE
        return sum(alarm.rings for alarm in self.alarms) + (0 if out else self.beyond)

    @property
    def shift_times(self) -> tuple[int, ...]:
        """Stamps of the alarms of the last shift, by the clock of the stand."""
        latest_ns = max((*self.alarm_times[-1:], self.group.stamp_ns if self.group else NEVER_NS))
        return of_shift(self.alarm_times, latest_ns)

    @property
    def open_key(self) -> Key | None:
        """Alarm of the episode that is open now."""
        group = self.group
        if group is None or group.detected_stamp_ns == NEVER_NS:
            return None
        return group.source, group.detected_stamp_ns

    def silent(self, record_type: type, now_ns: int) -> bool:
        """Whether a stream that was running has stopped."""
        return self.stream(record_type).standing(now_ns) == "stale"


def fold(state: OperatorState, record: Record, arrived_ns: int) -> OperatorState:
    """State after one more record, received at ``arrived_ns`` (any monotonic clock)."""
    state = _counted(state, record, arrived_ns)
    take = _FOLDS.get(type(record))
    return state if take is None else take(state, record, arrived_ns)


def aged(state: OperatorState, now_ns: int) -> OperatorState:
    """State after elapsed time alone: a detection without a verdict becomes an alarm."""
    flag = state.detection
    if flag is None or not flag.detected or state.group is not None:
        return state
    alarm = alarms_of.of_detection(flag, "live")
    known = any(entry.key == alarm.key for entry in state.alarms)
    if known or now_ns - state.detection_arrived_ns < ALONE_NS:
        return state
    return _with_alarm(state, alarm)


def _counted(state: OperatorState, record: Record, arrived_ns: int) -> OperatorState:
    stream = state.streams.get(TOPIC_OF[type(record)].name.lstrip("/"))
    if stream is None:
        return state
    if isinstance(record, Scan | Residual) and jumped_back(stream, record.stamp_ns):
        state = _anew(state)
        stream = state.streams[stream.name]
    period_ns = scan_period_ns(state.channels) if isinstance(record, Scan) else 0
    changed = counted(stream, record, arrived_ns, period_ns)
    return replace(state, streams={**state.streams, stream.name: changed})


def _anew(state: OperatorState) -> OperatorState:
    """State for a new run on the same stand: remarks and alarms are kept, measurements are not."""
    fresh = {
        name: replace(stream, stamp_ns=NEVER_NS, since_ns=NEVER_NS)
        for name, stream in state.streams.items()
    }
    return replace(
        state, scan=None, residual=None, level=None, trend=None, steps=(), symbols=(), features=(),
        streams=fresh,
    )  # fmt: skip


def _with_group(state: OperatorState, group: AmbiguityGroup, _: int) -> OperatorState:
    before = state.group
    group = group.with_hypotheses(state.hypotheses)
    state = replace(state, group=group)
    if before is not None and before.detected_stamp_ns not in (NEVER_NS, group.detected_stamp_ns):
        state = _closed(state, before, group.stamp_ns)
    if group.detected_stamp_ns != NEVER_NS:
        state = _with_alarm(state, _alarm_of(state, group))
    return _with_step(state, group)


def _with_step(state: OperatorState, group: AmbiguityGroup) -> OperatorState:
    """Add a change of the group; its faults ruled out become known with the hypotheses."""
    faults = tuple(candidate.fault for candidate in group.members)
    key = group.detected_stamp_ns, group.episode, group.outcome, faults
    steps, last = state.steps, state.steps[-1] if state.steps else None
    if last is not None and (last.detected_ns, last.episode, last.outcome, last.faults) == key:
        if last.dropped or not group.dropped:
            return state
        steps = steps[:-1]
    known = {name for step in steps if step.detected_ns == key[0] for name, _ in step.dropped}
    dropped = tuple((c.fault, c.reason) for c in group.dropped if c.fault not in known)
    step = GroupStep(group.stamp_ns, *key, dropped)
    return replace(state, steps=(*steps, step)[-MOST_STEPS:])


def _with_hypotheses(state: OperatorState, found: Hypotheses, arrived_ns: int) -> OperatorState:
    """Complete the verdict that these hypotheses belong to, if it came first."""
    state = replace(state, hypotheses=found)
    group = state.group
    if group is None or group.verdict != found.verdict:
        return state
    return _with_group(state, group, arrived_ns)


def _alarm_of(state: OperatorState, group: AmbiguityGroup) -> Alarm:
    key = group.source, group.detected_stamp_ns
    known = next((entry for entry in state.alarms if entry.key == key), None)
    alarm = alarms_of.of_group(group) if known is None else alarms_of.with_group(known, group)
    flag = state.detection
    if flag is not None and flag.detected and flag.stamp_ns == alarm.detected_ns:
        alarm = alarms_of.with_detection(alarm, flag)
    return alarm


def _closed(state: OperatorState, before: AmbiguityGroup, stamp_ns: int) -> OperatorState:
    key = before.source, before.detected_stamp_ns
    return replace(
        state,
        alarms=tuple(
            replace(entry, closed_ns=stamp_ns) if entry.key == key else entry
            for entry in state.alarms
        ),
    )


def _with_alarm(state: OperatorState, alarm: Alarm) -> OperatorState:
    if any(entry.key == alarm.key for entry in state.alarms):
        known = (alarm if entry.key == alarm.key else entry for entry in state.alarms)
        return replace(state, alarms=tuple(known))
    times = state.alarm_times
    if alarm.detected_ns not in times:
        times = (*times, alarm.detected_ns)[-MOST_TIMES:]
    kept = alarms_of.bounded((*state.alarms, alarm), MOST_ALARMS)
    return replace(state, alarms=kept, alarm_times=times)


def _with_detection(state: OperatorState, flag: Detection, arrived_ns: int) -> OperatorState:
    state = replace(state, detection=flag, detection_arrived_ns=arrived_ns)
    if not flag.detected or state.group is None:
        return state
    key = state.group.source, flag.stamp_ns
    known = next((entry for entry in state.alarms if entry.key == key), None)
    if known is not None:
        return _with_alarm(state, alarms_of.with_detection(known, flag))
    if _before_last(state, flag):
        return state  # a vibration episode is open: the detection is evidence inside it
    return _with_alarm(state, alarms_of.of_detection(flag, state.group.source))


def _before_last(state: OperatorState, flag: Detection) -> bool:
    group = state.group
    return group is not None and group.detected_stamp_ns not in (NEVER_NS, flag.stamp_ns)


def _with_symbols(state: OperatorState, record: Symbols, _: int) -> OperatorState:
    latest = {c.symbol.residual: c.symbol for c in state.symbols if c.episode == record.episode}
    new = tuple(
        SymbolChange(record.stamp_ns, record.episode, symbol)
        for symbol in record.symbols
        if latest.get(symbol.residual) != symbol
    )
    state = replace(state, symbols=(*state.symbols, *new)[-MOST_SYMBOLS:])
    alarm = _open_alarm(state, record.stamp_ns)
    return state if alarm is None else _with_alarm(state, alarms_of.with_symbols(alarm, record))


def _open_alarm(state: OperatorState, stamp_ns: int) -> Alarm | None:
    """Alarm of the episode of a deviation; observer and isolator may number it differently."""
    source = state.group.source if state.group is not None else None
    fitting = (
        entry
        for entry in state.alarms
        if entry.source == source and entry.detected_ns <= stamp_ns and entry.closed_ns == NEVER_NS
    )
    return max(fitting, key=lambda entry: entry.detected_ns, default=None)


def _with_request(state: OperatorState, record: FeatureRequest, _: int) -> OperatorState:
    asked = AskedFeature(record.episode, record.step, record.feature, record.stamp_ns)
    return replace(state, features=(*state.features, asked)[-MOST_FEATURES:])


def _with_value(state: OperatorState, record: FeatureValue, _: int) -> OperatorState:
    asked = (record.episode, record.step, record.feature)
    answer = AskedFeature(*asked, record.stamp_ns, record)
    for index, entry in enumerate(state.features):
        if (entry.episode, entry.step, entry.name) == asked:
            answer = replace(entry, value=record)
            features = (*state.features[:index], answer, *state.features[index + 1 :])
            return replace(state, features=features)
    return replace(state, features=(*state.features, answer)[-MOST_FEATURES:])


def _with_health(state: OperatorState, record: Health, _: int) -> OperatorState:
    if record.node not in state.health and len(state.health) >= MOST_NODES:
        return state
    return replace(state, health={**state.health, record.node: record})


def _latest(name: str) -> Callable[[OperatorState, Any, int], OperatorState]:
    def take(state: OperatorState, record: Any, _: int) -> OperatorState:
        return replace(state, **{name: record})

    return take


_FOLDS: dict[type, Callable[[OperatorState, Any, int], OperatorState]] = {
    AmbiguityGroup: _with_group,
    ChannelTable: _latest("channels"),
    DataQuality: _latest("quality"),
    Detection: _with_detection,
    FeatureRequest: _with_request,
    FeatureValue: _with_value,
    Health: _with_health,
    Hypotheses: _with_hypotheses,
    Residual: _latest("residual"),
    Scan: _latest("scan"),
    SizeTrend: _latest("trend"),
    Symbols: _with_symbols,
    Truth: _latest("truth"),
    VibrationLevel: _latest("level"),
}

SHOWN: tuple[type, ...] = tuple(_FOLDS)
"""Record types that are folded; a screen subscribes to them."""
