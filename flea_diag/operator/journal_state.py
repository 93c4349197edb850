"""What a state takes from elsewhere than records: the journal, the clock, counts of losses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flea_diag.operator import alarm as alarms_of
from flea_diag.operator.alarm import Alarm, AlarmAction, Comment
from flea_diag.operator.state import MOST_ALARMS, OperatorState


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
) -> OperatorState:
    """Merge the content of a journal: older alarms, acknowledgements, comments and marks.

    Detection and verdict of an alarm come from the records; remarks come from the journal.
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
    return replace(state, alarms=tuple(merged[-MOST_ALARMS:]), marks=marks, service=service)


def as_of(state: OperatorState, wall_ns: int) -> OperatorState:
    """State at a moment of the wall clock: shelvings that have ended ring again."""
    alarms = tuple(alarms_of.as_of(alarm, state.service, wall_ns) for alarm in state.alarms)
    if all(new is old for new, old in zip(alarms, state.alarms, strict=True)):
        return state
    return replace(state, alarms=alarms)
