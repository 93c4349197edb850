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
