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

"""How a fault comes and goes, in words."""

from __future__ import annotations

import math

from flea_diag.wire.records import Recurrence


def recurrence_words(told: Recurrence, start_ns: int) -> str:
    """As after "which": times are seconds after the start of the stand."""
    since_s = (told.first_ns - start_ns) / 1e9
    words = [f"comes and goes: {_times(told)} since {since_s:.1f} s", _lasts(told)]
    if math.isfinite(told.every_s):
        words.append(f"every {told.every_s:.2g} s")
    if math.isfinite(told.place):
        words.append(_place(told))
    return ", ".join(words)


def _times(told: Recurrence) -> str:
    """How often; where it may have come more often, for how long that could not be seen."""
    if told.most <= told.count:
        return f"{told.count} times"
    return (
        f"at least {told.count} times, at most {told.most} with {told.unseen_s:.0f} s in which the "
        "motion and its current could not show it,"
    )


def _place(told: Recurrence) -> str:
    if told.place_unit == "rad":
        return f"at {math.degrees(told.place):.1f} deg of the turn"
    return f"at {told.place * 1e3:.0f} mm of the stroke"


def _lasts(told: Recurrence) -> str:
    """For how long each time, and the share of the time."""
    if not told.present_s:
        return f"each time for less than {told.shortest_s:.2g} s"
    each_s = told.present_s / told.count
    return f"each time for about {each_s:.2g} s ({100.0 * told.duty:.0f} % of the time)"
