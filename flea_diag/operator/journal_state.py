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

"""What a state takes from elsewhere than the stand: journal, remarks, clock, counts of losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flea_diag.operator import alarm as alarms_of
from flea_diag.operator.alarm import Alarm, AlarmAction, Comment
from flea_diag.operator.state import MOST_ALARMS, MOST_TIMES, OperatorState
from flea_diag.wire.records import NEVER_NS, Remark, RemarkKind


def with_losses(state: OperatorState, lost: Mapping[str, int]) -> OperatorState:
    """Add the losses reported by the middleware, by topic name without leading slash."""
    changed = {
        name: replace(state.streams[name], lost=count)
        for name, count in lost.items()
        if name in state.streams and state.streams[name].lost != count
    }
    return replace(state, streams={**state.streams, **changed}) if changed else state


def with_journal(
    state: OperatorState,
    kept: tuple[Alarm, ...],
    marks: tuple[Comment, ...] = (),
    service: AlarmAction | None = None,
    times: tuple[int, ...] = (),
    waiting: int = 0,
) -> OperatorState:
    """Merge the content of a journal: older alarms, acknowledgements, comments and marks.

    Detection and verdict of an alarm come from the records; remarks come from the journal.
    ``times`` are the stamps of all its latest alarms, and ``waiting`` those not acknowledged.
    """
    known = {entry.key: entry for entry in kept}
    for alarm in state.alarms:
        said = known.get(alarm.key, alarm)
        known[alarm.key] = replace(
            alarm,
            acknowledged_ns=said.acknowledged_ns,
            acknowledged_by=said.acknowledged_by,
            comments=said.comments,
            actions=said.actions,
            deviations=alarm.deviations or said.deviations,
        )
    merged = sorted(known.values(), key=lambda entry: entry.detected_ns)
    counted = sorted({*times, *state.alarm_times, *(alarm.detected_ns for alarm in merged)})
    return replace(
        state,
        alarms=alarms_of.bounded(merged, MOST_ALARMS),
        alarm_times=tuple(counted[-MOST_TIMES:]),
        waiting=waiting,
        marks=marks,
        service=service,
    )


def as_of(state: OperatorState, wall_ns: int) -> OperatorState:
    """State at a moment of the wall clock: shelvings that have ended ring again."""
    alarms = tuple(alarms_of.as_of(alarm, state.service, wall_ns) for alarm in state.alarms)
    if all(new is old for new, old in zip(alarms, state.alarms, strict=True)):
        return state
    return replace(state, alarms=alarms)


# --- a recording, which has no journal: remarks alone

ACTIONS = (RemarkKind.WITHDRAWN, RemarkKind.SHELVED, RemarkKind.UNSHELVED)


def with_remark(state: OperatorState, remark: Remark) -> OperatorState:
    """State after one remark; a remark on an alarm that is not there says nothing."""
    said = Comment(remark.stamp_ns, remark.author, remark.text)
    if remark.kind is RemarkKind.MARK or remark.kind.is_on_unit:
        return replace(state, marks=(*state.marks, said))
    if remark.kind.is_on_service:
        return replace(state, service=_action(remark))
    key = remark.source, remark.detected_ns
    alarms = tuple(_told(a, remark, said) if a.key == key else a for a in state.alarms)
    return replace(state, alarms=alarms)


def _action(remark: Remark) -> AlarmAction:
    return AlarmAction(remark.stamp_ns, remark.kind, remark.author, remark.text, remark.until_ns)


def _told(alarm: Alarm, remark: Remark, said: Comment) -> Alarm:
    if remark.kind is RemarkKind.COMMENT:
        return replace(alarm, comments=(*alarm.comments, said))
    if remark.kind in ACTIONS:
        alarm = replace(alarm, actions=(*alarm.actions, _action(remark)))
    if remark.kind is RemarkKind.WITHDRAWN:
        return replace(alarm, acknowledged_ns=NEVER_NS, acknowledged_by="")
    if remark.kind is RemarkKind.ACKNOWLEDGED and alarm.standing:
        return replace(alarm, acknowledged_ns=remark.stamp_ns, acknowledged_by=remark.author)
    return alarm
