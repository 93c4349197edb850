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

"""The ambiguity group as a flow diagram: the faults ruled out by each piece of evidence."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from flea_diag.operator.verdict_view import likely, standing_of
from flea_diag.operator.words import tr
from flea_diag.web.history import Drop, drops
from flea_diag.web.markup import Markup, joined, path, tag, text
from flea_diag.wire.records import AmbiguityGroup

WIDTH, TOP, BAR = 1000.0, 22.0, 10.0
STREAM = 190.0
"""Height of the whole catalogue."""
THINNEST = 2.5
"""Least height of one fault, so that the last one stays visible."""
MOST_STEPS = 8
NAMED = 8
"""Largest number of faults named at the end of the flow; more are counted."""
ROOM_FOR_NAMES = 210.0
BETWEEN = ", "
FALL = 34.0
"""Distance below the flow at which a branch of dropped faults ends."""
LONGEST_NAME = 30
"""Letters of a name at the end of the flow."""


@dataclass(frozen=True)
class Step:
    """The flow between two bars: ``before`` faults enter, ``gone`` of them leave."""

    before: int
    gone: int
    label: str
    when: str
    detail: str


def steps(group: AmbiguityGroup) -> tuple[Step, ...]:
    """Steps of an episode; simultaneous drops are merged, and neighbours if there are too many."""
    found: list[Drop] = []
    for drop in drops(group):
        at_once = bool(found) and found[-1].stamp_ns == drop.stamp_ns
        found[-1:] = [_merged(found[-1], drop)] if at_once else [*found[-1:], drop]
    while len(found) > MOST_STEPS:
        sizes = [len(a.candidates) + len(b.candidates) for a, b in itertools.pairwise(found)]
        at = sizes.index(min(sizes))
        found[at : at + 2] = [_merged(found[at], found[at + 1])]
    left = len(group.members) + len(group.dropped)
    rows = []
    for drop in found:
        rows.append(_step(group, drop, left))
        left -= len(drop.candidates)
    return tuple(rows)


def _merged(one: Drop, other: Drop) -> Drop:
    sources = dict.fromkeys(f"{one.source}{BETWEEN}{other.source}".split(BETWEEN))
    return Drop(other.stamp_ns, BETWEEN.join(sources), one.candidates + other.candidates)


def _step(group: AmbiguityGroup, drop: Drop, left: int) -> Step:
    after_s = (drop.stamp_ns - group.detected_stamp_ns) / 1e9
    detail = "\n".join(f"{c.fault}: {c.reason}" for c in drop.candidates)
    sources = drop.source.split(BETWEEN)
    label = sources[0] if len(sources) == 1 else tr("{count} findings", count=len(sources))
    return Step(left, len(drop.candidates), label, f"+{after_s:.2f} s", detail)


def group_flow(group: AmbiguityGroup) -> Markup:
    """SVG of the episode of this verdict."""
    rows = steps(group)
    total = len(group.members) + len(group.dropped)
    unit = max(STREAM / max(total, 1), THINNEST)
    gap = (WIDTH - ROOM_FOR_NAMES) / max(len(rows), 1)
    parts = [_bar(k * gap, step.before, unit) for k, step in enumerate(rows)]
    parts += [_stream(k * gap, gap, step, unit) for k, step in enumerate(rows)]
    parts.append(_bar(len(rows) * gap, len(group.members), unit))
    parts.append(_names(len(rows) * gap + BAR + 8, group))
    height = TOP + unit * total + FALL + 44
    return tag(
        "svg",
        tag("title", _words(total, group)),
        *parts,
        viewBox=f"-14 0 {WIDTH + 28:.0f} {height:.0f}",
        role="img",
        class_="flow",
    )


def _words(total: int, group: AmbiguityGroup) -> str:
    return tr(
        "From {count} faults of the catalogue to {rest}", count=total, rest=standing_of(group)
    )


def _bar(x: float, count: int, unit: float) -> Markup:
    height = max(count * unit, 1.0)
    return joined(
        tag("rect", x=f"{x:.1f}", y=TOP, width=BAR, height=f"{height:.1f}", class_="bar"),
        text(x + BAR / 2, TOP - 7, count, "count", "middle"),
    )


def _stream(x: float, gap: float, step: Step, unit: float) -> Markup:
    left, right = x + BAR, x + gap
    kept = (step.before - step.gone) * unit
    bottom = TOP + step.before * unit
    end = left + (right - left) * 0.55
    fallen = bottom + FALL
    stay = (
        f"M{left:.1f},{TOP} H{right:.1f} V{TOP + kept:.1f} H{left:.1f} Z"
        if kept
        else f"M{left:.1f},{TOP} Z"
    )
    middle = (left + end) / 2
    fall = (
        f"M{left:.1f},{TOP + kept:.1f} C{middle:.1f},{TOP + kept:.1f} {end:.1f},{bottom:.1f} "
        f"{end:.1f},{fallen:.1f} H{end - 5:.1f} C{end - 5:.1f},{fallen - 8:.1f} "
        f"{middle - 5:.1f},{bottom:.1f} {left:.1f},{bottom:.1f} Z"
    )
    label = tag(
        "g",
        text(end - 2, fallen + 13, f"−{step.gone}", "gone", "middle"),
        text(end - 2, fallen + 25, _fitting(step.label, gap), "why", "middle"),
        text(end - 2, fallen + 37, step.when, "when", "middle"),
        tag("title", step.detail),
    )
    return joined(path(stay, "stays"), path(fall, "falls", tag("title", step.detail)), label)


def _fitting(label: str, room: float) -> str:
    letters = int(room / 6.6)
    return label if len(label) <= letters else label[: letters - 1] + "…"


def _named(fault: str) -> str:
    """A name that fits beside the last bar."""
    return fault if len(fault) <= LONGEST_NAME else f"{fault[: LONGEST_NAME - 1]}…"


def _names(x: float, group: AmbiguityGroup) -> Markup:
    shown = group.members[:NAMED]
    rows = [
        text(
            x, TOP + 12 + 16 * k, f"{_named(c.fault)}  {likely(c, len(group.members) == 1)}", "left"
        )
        for k, c in enumerate(shown)
    ]
    more = len(group.members) - len(shown)
    if more:
        rows.append(text(x, TOP + 12 + 16 * len(shown), tr("and {count} more", count=more), "why"))
    if not shown:
        rows.append(text(x, TOP + 12, tr("no fault of the catalogue"), "left"))
    return joined(*rows)
