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

"""Summary of a diagnosis as one JSON object and as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from flea_diag.core.faults.fault import MODES
from flea_diag.formats import stamped
from flea_diag.operator.judgement_view import JudgedRow, judged_rows
from flea_diag.stages.digest import decision_digest, digest
from flea_diag.wire.blocks import Block, ResidualBlock, ScanBlock, Stamps
from flea_diag.wire.records import (
    NEVER_NS,
    TOLD,
    AmbiguityGroup,
    Candidate,
    ChannelQuality,
    DataQuality,
    FeatureValue,
    Outcome,
    Quality,
    Record,
    Residual,
    Scan,
    VibrationBlock,
    VibrationLevel,
)

_SOUND = (Quality.GOOD, Quality.ABSENT)
OF_SENSORS = tuple(f"_{mode}" for mode in MODES)
"""How the faults of sensors end: their sizes are in the JSON."""
BULK = (Residual, ResidualBlock, VibrationLevel, VibrationBlock)
"""Frequent record types that a summary does not need."""


def without_values(record: Record | Block) -> Record | Block:
    """The record reduced to what a summary needs: of scans the stamps only, to save memory."""
    if isinstance(record, ScanBlock):
        return ScanBlock(record.stamps_ns, (), np.empty((len(record), 0)))
    return record


def summarise(records: Iterable[Record | Block]) -> dict[str, Any]:
    """Summarise a diagnosis from its records: scans, single or in blocks, and results.

    Times are seconds after the first scan. The episode fields at the top level are those of the
    first episode; without an episode, ``outcome`` is that of the last verdict.
    """
    whole = list(records)
    scans = _stamps_ns(whole)
    known = [record for record in whole if not isinstance(record, (ScanBlock, ResidualBlock))]
    start_ns = int(scans[0]) if len(scans) else 0
    groups = [record for record in known if isinstance(record, AmbiguityGroup)]
    episodes = [_episode(part, start_ns) for part in _by_episode(groups)]
    last = groups[-1] if groups else None
    quiet: dict[str, Any] = {
        "outcome": last.outcome.value if last else None,
        "detected_at_s": None,
        "isolated_at_s": None,
        "ambiguity_group": [],
    }
    first = episodes[0] if episodes else quiet
    summary = {
        **{key: first[key] for key in quiet},
        "episodes": episodes,
        "looked_for": list(last.looked_for) if last else [],
        "not_observable": _not_observable(last),
        "shows_from": dict(last.shows_from) if last else {},
        "false_alarms_per_hour": _promise(last),
        "features_computed": _features(known),
        "data_quality": _data_quality(known, start_ns),
        "judged": _judged(known),
        "digest": digest(known),
        "decision_digest": decision_digest(known),
        "scans": len(scans),
        "duration_s": _seconds(int(scans.max()), start_ns) if len(scans) else 0.0,
    }
    return stamped("replay summary", summary)


def _stamps_ns(records: Sequence[Record | Block]) -> Stamps:
    parts = [
        record.stamps_ns if isinstance(record, ScanBlock) else np.array([record.stamp_ns])
        for record in records
        if isinstance(record, (Scan, ScanBlock))
    ]
    return np.concatenate(parts) if parts else np.array([], dtype=np.int64)


def _seconds(stamp_ns: int, start_ns: int) -> float | None:
    return None if stamp_ns == NEVER_NS else (stamp_ns - start_ns) / 1e9


def _by_episode(groups: Sequence[AmbiguityGroup]) -> list[list[AmbiguityGroup]]:
    """Groups of each episode, in order; number 0 is between episodes and skipped."""
    parts: dict[int, list[AmbiguityGroup]] = {}
    for group in groups:
        if group.episode > 0:
            parts.setdefault(group.episode, []).append(group)
    return list(parts.values())


def _episode(groups: Sequence[AmbiguityGroup], start_ns: int) -> dict[str, Any]:
    last = groups[-1]
    settled_ns = _settled_ns(groups)
    isolated = last.outcome is Outcome.ISOLATED
    return {
        "episode": last.episode,
        "outcome": last.outcome.value,
        "detected_at_s": _seconds(groups[0].detected_stamp_ns, start_ns),
        "isolated_at_s": _seconds(settled_ns, start_ns) if isolated else None,
        "settled_at_s": _seconds(settled_ns, start_ns),
        "ambiguity_group": [candidate.fault for candidate in last.members],
        "probabilities": [candidate.probability for candidate in last.members],
        "words": last.words,
        "comes_and_goes": _comes_and_goes(last, start_ns),
        "dropped": {candidate.fault: candidate.reason for candidate in last.dropped},
        "detected_by": last.opened_by,
        "kept": {candidate.fault: _last_evidence(candidate) for candidate in last.members},
        "steps": _steps(groups, start_ns),
    }


def _comes_and_goes(last: AmbiguityGroup, start_ns: int) -> dict[str, Any] | None:
    """How the members come and go, None: they stay; a rhythm or a place is None where unknown."""
    for told in last.comes_and_goes:
        rest = {name: value if isinstance(value, str) or math.isfinite(value) else None
                for name, value in asdict(told).items() if not name.endswith("_ns")}  # fmt: skip
        times = told.first_ns, told.last_ns
        first_s, last_s = (_seconds(stamp_ns, start_ns) for stamp_ns in times)
        return {**rest, "first_at_s": first_s, "last_at_s": last_s, "duty": told.duty}
    return None


def _last_evidence(candidate: Candidate) -> str:
    """Latest evidence on a possible fault."""
    if not candidate.evidence:
        return candidate.reason
    last = candidate.evidence[-1]
    return f"{last.source}: observed {last.observed}, predicted {last.predicted}: {last.verdict}"


def _steps(groups: Sequence[AmbiguityGroup], start_ns: int) -> list[dict[str, Any]]:
    """The group at each change of its members or its outcome."""
    steps: list[dict[str, Any]] = []
    for group in groups:
        step = {
            "outcome": group.outcome.value,
            "members": sorted(candidate.fault for candidate in group.members),
        }
        if not steps or any(steps[-1][key] != value for key, value in step.items()):
            steps.append({"at_s": _seconds(group.stamp_ns, start_ns), **step})
    return steps


def _settled_ns(groups: Sequence[AmbiguityGroup]) -> int:
    """Stamp from which on the final outcome and members of the episode stood."""

    def verdict(group: AmbiguityGroup) -> tuple[Outcome, frozenset[str]]:
        return group.outcome, frozenset(candidate.fault for candidate in group.members)

    settled = groups[-1]
    for group in reversed(groups):
        if verdict(group) != verdict(settled):
            break
        settled = group
    return settled.stamp_ns


def _not_observable(last: AmbiguityGroup | None) -> list[dict[str, str]]:
    return [
        {"fault": fault, "reason": reason}
        for fault, reason in (last.not_observable if last else ())
    ]


def _promise(last: AmbiguityGroup | None) -> dict[str, float | None]:
    """Rates that the calibration states and supports; None where unknown or without a bound."""
    rates = {"stated": math.nan, "supported": math.nan}
    if last is not None:
        rates["stated"] = last.stated_false_alarms_per_hour
        rates["supported"] = last.supported_false_alarms_per_hour
    return {name: rate if math.isfinite(rate) else None for name, rate in rates.items()}


def _features(records: Sequence[Record]) -> list[str]:
    """Features that were answered, and those on which a verdict is based."""
    names: dict[str, None] = {}
    for record in records:
        if isinstance(record, FeatureValue) and not record.reason:
            names[record.feature] = None
        elif isinstance(record, AmbiguityGroup):
            names.update(dict.fromkeys(record.features_computed))
    return list(names)


def _data_quality(records: Sequence[Record], start_ns: int) -> dict[str, Any]:
    """Last state, counters, and all stretches of reduced quality of each channel."""
    channels: dict[str, dict[str, Any]] = {}
    for record in records:
        if isinstance(record, DataQuality):
            for row in record.channels:
                known = channels.setdefault(row.channel, {"quality": None, "stretches": []})
                _note(known, row, _seconds(row.since_ns, start_ns))
                known["last_reading_s"] = _seconds(row.read_ns, start_ns)
    return channels


def _judged(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Share of the scans that each test has judged, of the last 10 s and of the run; why not."""
    last = next((r for r in reversed(records) if isinstance(r, DataQuality) and r.judged), None)
    return [{**asdict(row), "cause": row.cause or None, "why": row.why or None}
            for row in judged_rows(last)]  # fmt: skip


def _note(known: dict[str, Any], row: ChannelQuality, since_s: float | None) -> None:
    turned = row.channel in TOLD and row.reason != known.get("reason", "")
    if row.quality.value != known["quality"] or turned:
        if known["stretches"] and known["stretches"][-1]["to_s"] is None:
            known["stretches"][-1]["to_s"] = since_s
        if row.quality not in _SOUND or (row.channel in TOLD and row.reason):
            stretch = {"quality": row.quality.value, "reason": row.reason}
            known["stretches"].append({**stretch, "from_s": since_s, "to_s": None})
    known.update(quality=row.quality.value, reason=row.reason, counters=dict(row.counters))


def in_words(summary: dict[str, Any]) -> str:
    """Summary of a bag in a few lines of text."""
    lines = [f"{summary['bag']}: {summary['outcome'] or 'no verdict'}"]
    for episode in summary["episodes"]:
        lines.append(_episode_words(episode))
    if summary["episodes"]:
        lines += _promise_words(summary["false_alarms_per_hour"])
    for channel, state in summary["data_quality"].items():
        for stretch in state["stretches"]:
            end = "the end" if stretch["to_s"] is None else f"{stretch['to_s']:.2f} s"
            lines.append(
                f"  {channel} {stretch['quality']} from {stretch['from_s']:.2f} s to {end}: "
                f"{stretch['reason']}"
            )
    lines += _not_judged_words(summary["judged"])
    reasons: dict[str, list[str]] = {}
    for entry in summary["not_observable"]:
        reasons.setdefault(entry["reason"], []).append(entry["fault"])
    lines += [f"  not observable: {', '.join(faults)} ({why})" for why, faults in reasons.items()]
    plant = [f"{f}: {size}" for f, size in summary["shows_from"].items()
             if not f.endswith(OF_SENSORS)]  # fmt: skip
    if plant:
        lines.append(f"  shows from: {'; '.join(plant)}")
    return "\n".join(lines)


def _not_judged_words(rows: Sequence[dict[str, Any]]) -> list[str]:
    """What was not judged at the end, by its reason; the shares are of the first of each."""
    groups: dict[str, list[JudgedRow]] = {}
    for row in (JudgedRow(**each) for each in rows if not each["judged"]):
        groups.setdefault(row.why, []).append(row)
    return [
        f"  not judged: {', '.join(row.test for row in group)} ({why}; "
        f"{group[0].recent_text} of the last 10 s, {group[0].run_text} of the run)"
        for why, group in groups.items()
    ]


def _promise_words(rates: dict[str, float | None]) -> list[str]:
    if rates["stated"] is None:
        return []
    bound = "no rate" if rates["supported"] is None else f"at most {rates['supported']:.2g}"
    stated = f"{rates['stated']:g} stated"
    return [f"  false alarms per hour: {stated}, {bound} supported by the calibration"]


def _episode_words(episode: dict[str, Any]) -> str:
    times = f"detected at {episode['detected_at_s']:.2f} s"
    if episode["settled_at_s"] is not None:
        times += f", verdict since {episode['settled_at_s']:.2f} s"
    return f"  {episode['outcome']}: {episode['words']} ({times})"
