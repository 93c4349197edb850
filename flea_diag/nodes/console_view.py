"""What the console shows, made from records alone: ``view`` is a screen, ``line`` one change."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime, timezone

from flea_diag.wire.records import (
    NEVER_NS,
    OUTCOME_LEVEL,
    AmbiguityGroup,
    Candidate,
    DataQuality,
    FeatureValue,
    Health,
    Level,
    Outcome,
    Quality,
    Record,
    Truth,
)

SILENT_AFTER_S = 2.5
"""The verdict comes once a second; two in a row missing means that its writer is gone."""

OPEN_OUTCOMES = (Outcome.DETECTED, Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, Outcome.UNEXPLAINED)


@dataclass(frozen=True)
class ConsoleState:
    """The latest record of each kind; ``silent_s`` is how long no verdict came."""

    group: AmbiguityGroup | None = None
    quality: DataQuality | None = None
    truth: Truth | None = None
    features: tuple[FeatureValue, ...] = ()
    health: dict[str, Health] = field(default_factory=dict)
    silent_s: float = 0.0


def update(state: ConsoleState, record: Record) -> ConsoleState:
    """State after one more record."""
    if isinstance(record, AmbiguityGroup):
        return _with_group(state, record)
    if isinstance(record, DataQuality):
        return replace(state, quality=record)
    if isinstance(record, Truth):
        return replace(state, truth=record)
    if isinstance(record, FeatureValue):
        return replace(state, features=(*state.features, record))
    if isinstance(record, Health):
        return replace(state, health={**state.health, record.node: record})
    return state


def _with_group(state: ConsoleState, group: AmbiguityGroup) -> ConsoleState:
    new_episode = state.group is not None and group.episode != state.group.episode
    features = () if new_episode else state.features
    return replace(state, group=group, silent_s=0.0, features=features)


def line(state: ConsoleState) -> str:
    """The verdict in one line, for a pipe or a log; equal as long as nothing changed."""
    group = state.group
    if group is None:
        return "no verdict yet"
    if state.silent_s > SILENT_AFTER_S:
        return "NO VERDICT: the isolator is silent"
    return (
        f"{_clock(group.stamp_ns)} {_level(group)} {group.outcome.value}{_named(group)}: "
        f"{group.words}"
    )


def _named(group: AmbiguityGroup) -> str:
    """How many are possible, and which, unless the words name them all."""
    faults = [candidate.fault for candidate in group.members]
    if not faults:
        return ""
    told = all(fault in group.words for fault in faults)
    return (
        f" ({len(faults)} possible)" if told else f" ({len(faults)} possible: {', '.join(faults)})"
    )


def view(state: ConsoleState) -> str:
    """The whole screen."""
    blocks = [_verdict(state), *_groups(state), _features(state), _quality(state), _health(state)]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _verdict(state: ConsoleState) -> str:
    group = state.group
    if group is None:
        return "VERDICT  none yet: waiting for ambiguity_group"
    lines = [f"VERDICT  {_level(group)}  {group.outcome.value}  {group.words}"]
    if state.silent_s > SILENT_AFTER_S:
        lines.insert(0, f"NO VERDICT for {state.silent_s:.0f} s: the last one stands below")
    elif group.stale:
        lines.append("         STALE: the stand sends no data, this is the last verdict")
    lines.append(
        f"         episode {group.episode}, step {group.step}, number {group.seq}, "
        f"evidence up to {_clock(group.stamp_ns)} UTC, {group.source}"
    )
    if group.detected_stamp_ns != NEVER_NS:
        lines.append(f"         detected at {_clock(group.detected_stamp_ns)} UTC")
    if state.truth is not None and state.truth.fault:
        onset = state.truth.onset_ns
        at = "" if onset == NEVER_NS else f" from {_clock(onset)} UTC on"
        lines.append(f"         the stand says: {state.truth.fault}{at}")
    return "\n".join(lines)


def _groups(state: ConsoleState) -> list[str]:
    group = state.group
    if group is None:
        return []
    blocks = []
    if group.members and group.outcome in OPEN_OUTCOMES:
        rows = [_candidate(rank, entry) for rank, entry in enumerate(group.members, 1)]
        blocks.append(f"POSSIBLE ({len(group.members)})\n" + "\n".join(rows))
    if group.dropped:
        rows = [f"  {entry.fault:28} {entry.reason}" for entry in group.dropped]
        blocks.append(f"DROPPED ({len(group.dropped)})\n" + "\n".join(rows))
    if group.not_observable:
        rows = [f"  {fault:28} {why}" for fault, why in group.not_observable]
        blocks.append("CANNOT BE SEEN HERE\n" + "\n".join(rows))
    return blocks


def _candidate(rank: int, entry: Candidate) -> str:
    size = ""
    if entry.size == entry.size:
        spread = f" ± {entry.size_sigma:.2g}" if entry.size_sigma == entry.size_sigma else ""
        size = f"  size {entry.size:.3g}{spread} {entry.size_unit}".rstrip()
    text = f"  {rank}. {entry.fault:25} {entry.probability:5.0%}  {entry.hypothesis}{size}"
    return f"{text}\n     {'':25} {entry.reason}"


def _features(state: ConsoleState) -> str:
    group = state.group
    if group is None or not group.features_available:
        return ""
    title = f"FEATURES  {len(group.features_computed)} of {group.features_available} computed"
    rows = [
        f"  {value.feature:28} {value.value:.4g} {value.unit}  {value.symbol}"
        f"  (nominal {value.nominal_low:.3g} to {value.nominal_high:.3g}, {value.cost_ms:.2f} ms)"
        if value.value == value.value
        else f"  {value.feature:28} not computable: {value.reason}"
        for value in state.features
        if value.episode == group.episode
    ]
    return "\n".join([title, *rows])


def _quality(state: ConsoleState) -> str:
    if state.quality is None:
        return ""
    bad = [row for row in state.quality.channels if row.quality != Quality.GOOD]
    good = len(state.quality.channels) - len(bad)
    rows = [
        f"  {row.channel:28} {row.quality.value} since {_clock(row.since_ns)}: {row.reason}"
        for row in bad
    ]
    return "\n".join([f"CHANNELS  {good} good, {len(bad)} not", *rows])


def _health(state: ConsoleState) -> str:
    if not state.health:
        return ""
    rows = []
    for node, health in sorted(state.health.items()):
        shown = [f"{key} {value}" for key, value in health.values if _worth_showing(key, value)]
        rows.append(f"  {node:20} {health.level.name:5} {health.message}  {', '.join(shown)}")
    return "\n".join(["NODES", *(row.rstrip() for row in rows)])


def _worth_showing(key: str, value: str) -> bool:
    counted = key.rsplit("/", 1)[-1]
    return "/" not in key or counted == "received" or value != "0"


def _level(group: AmbiguityGroup) -> str:
    return (Level.STALE if group.stale else OUTCOME_LEVEL[group.outcome]).name


def _clock(stamp_ns: int) -> str:
    if stamp_ns == NEVER_NS:
        return "--:--:--"
    moment = datetime.fromtimestamp(stamp_ns // 1_000_000_000, tz=timezone.utc)
    return f"{moment:%H:%M:%S}.{stamp_ns // 1_000_000 % 1000:03d}"
