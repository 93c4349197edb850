"""Which alarms of a list are shown: the same choice on console and page."""

from __future__ import annotations

from collections.abc import Callable

from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.words import later
from flea_diag.wire.records import NEVER_NS

Test = Callable[[Alarm, Key | None], bool]
"""Whether an alarm is shown, given the key of the episode that is open."""

EVERY = "every"
FILTERS: dict[str, tuple[str, Test]] = {
    EVERY: (later("all alarms"), lambda alarm, _: True),
    "standing": (later("not acknowledged"), lambda alarm, _: alarm.standing),
    "active": (later("active now"), lambda alarm, key: is_active(alarm, key)),
    "silenced": (later("shelved or out of service"), lambda alarm, _: bool(alarm.silenced)),
    "now": (later("priority 1"), lambda alarm, _: alarm.urgency == "now"),
    "soon": (later("priority 2"), lambda alarm, _: alarm.urgency == "soon"),
    "planned": (later("priority 3"), lambda alarm, _: alarm.urgency == "planned"),
}
"""Name of a filter: its words, and which alarms it shows."""


def is_active(alarm: Alarm, open_key: Key | None) -> bool:
    """Whether the episode of an alarm is open."""
    return alarm.key == open_key and alarm.closed_ns == NEVER_NS


def matching(alarm: Alarm, open_key: Key | None) -> tuple[str, ...]:
    """Names of the filters that show an alarm."""
    return tuple(name for name, (_, shows) in FILTERS.items() if shows(alarm, open_key))


def after(name: str) -> str:
    """The filter after this one, for a key that goes through them."""
    names = list(FILTERS)
    return names[(names.index(name) + 1) % len(names)]
