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

"""Joints, axes, drives and namespaces in a recording: groups of series, of which a stand is one.

Two series belong to two groups if their names differ in one word that says nothing of a reading:
``actual_q_0`` and ``actual_q_1``, ``/left/joint_states`` and ``/right/joint_states``,
``position[elbow]`` and ``position[shoulder]``.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flea_diag.errors import RecordingError, shown
from flea_diag.tools.series.recorded_series import RecordedSeries, Series
from flea_diag.tools.series.series_words import (
    OTHER,
    POSITION,
    QUALIFIERS,
    SPEED,
    is_quantity,
    unit_of,
    words_of,
)

_WORDS = re.compile(r"[a-z]+\d*|\d+")
_SLOTS = re.compile(r"\[[^/]*?\](?=[.\[]|$)|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^\W\d_]+")
_ANY = frozenset({"joint", "axis", "state", "states", "motor"})
"""Words of topics and joints that tell none from another."""
_OF_READINGS = frozenset({
    "actual", "feedback", "measured", "act", "meas", "raw", "filtered", "filt", "min", "max",
    "mean",
    "avg", "rms", "in", "out", "input", "output", "high", "low", "a", "b", "c", "d", "q", "data",
    "real", "est", "estimated", "position", "velocity", "effort", "acceleration", "demand",
    "window", "pos", "neg", "positive", "negative", "abs", "value", "linear", "angular", "ac",
    "new",
    "old",
})  # fmt: skip
"""Words that tell readings of one joint apart rather than joints."""
_JOINT_WORDS = frozenset({"joint", "joints", "axis", "motor", "drive", "servo"})
FEW, MANY = 2, 3
"""Quantities that come in groups, or groups of a position alone, from which on they are groups."""


@dataclass(frozen=True)
class RecordedJoints:
    """Groups of series.

    Parameters
    ----------
    names
        Those that move.
    chosen
        The one that is looked at; "" where there are none.
    rest
        Places of the series that are of another.
    """

    names: tuple[str, ...]
    chosen: str
    rest: frozenset[str] = field(default=frozenset())

    @classmethod
    def of(cls, recorded: RecordedSeries, wanted: str = "", group: str = "") -> RecordedJoints:
        """Groups of a recording, and of them the one wanted, or that of which most is recorded.

        Parameters
        ----------
        recorded
            The recording.
        wanted, group
            Words of the group to look at, such as a joint and a namespace; "" for any.

        Raises
        ------
        RecordingError
            None of these words moves.
        """
        parts = _parts(recorded.series)
        scores = _scores(recorded.series, parts)
        fits = {
            name: score
            for name, score in scores.items()
            if all(not w or w.lower() in _called(name) for w in (wanted, group))
        }
        if (wanted or group) and not fits:
            raise RecordingError(
                f"{recorded.path}: no joint {shown(wanted or group)} moves; joints that move are "
                f"{', '.join(map(_label, scores)) or 'none'}"
            )
        chosen = max(fits, key=lambda name: fits[name], default=())
        rest = frozenset(
            each.words for each, own in zip(recorded.series, parts, strict=True)
            if chosen and _is_of_another(each, own, chosen, scores)
        )  # fmt: skip
        return cls(tuple(map(_label, scores)), _label(chosen), rest)

    def is_of_another(self, series: Series) -> bool:
        """Whether a series of the recording is of another group than the chosen one."""
        return series.words in self.rest


def _called(name: Sequence[str]) -> tuple[str, ...]:
    """What a group may be called, in small letters."""
    return tuple(each.lower() for each in (_label(name), *name))


def _label(name: Sequence[str]) -> str:
    return " ".join(name)


def _slots(series: Series) -> tuple[str, ...]:
    """Words of the place; an element in brackets by name is one."""
    place = series.place
    text = place.get("column") or f"{place['topic']}/{place['field']}"
    return tuple(
        slot[1:-1] if slot.startswith("[") else slot.lower() for slot in _SLOTS.findall(text)
    )


_AXES = frozenset("xyzw")
"""Components of a vector in a message; in a table they are axes of a machine."""


def _is_telling(slot: str, is_table: bool) -> bool:
    """Whether a word may tell a group from another."""
    if slot in _AXES and not is_table:
        return False
    words = [word for word in re.findall(r"[a-z]+", slot.lower()) if word not in _ANY]
    known = [w for w in words if is_quantity(w) or w in QUALIFIERS or w in _OF_READINGS]
    return not known and not unit_of(slot, "")


def _parts(series: Sequence[Series]) -> list[dict[int, str]]:
    """Of each series the number of each set of groups that it is in -> its group there."""
    alternatives: dict[tuple[int, tuple[str, ...]], dict[str, list[int]]] = defaultdict(dict)
    slots = [_slots(each) for each in series]
    for number, own in enumerate(slots):
        for at, slot in enumerate(own):
            if len(own) > 1 and _is_telling(slot, "column" in series[number].place):
                key = at, (*own[:at], "*", *own[at + 1 :])
                alternatives[key].setdefault(slot, []).append(number)
    sets = [each for each in alternatives.values() if len(each) > 1]
    merged = _merged([set(each) for each in sets])
    quantity = [_quantity(each) for each in series]
    found: list[dict[int, str]] = [{} for _ in series]
    for number, words in enumerate(merged):
        ours = [each for each in sets if set(each) <= words]
        kinds = {quantity[k] for each in ours for some in each.values() for k in some}
        moves = kinds & {POSITION, SPEED, ""}
        many = len(words) >= MANY and moves and _are_joints(series, ours) and not all(
            series[k].place.get("type", "").endswith("/JointState")
            for each in ours for some in each.values() for k in some
        )  # fmt: skip
        if len(kinds - {OTHER, ""}) < FEW and not many:
            continue
        for each in ours:
            for slot, some in each.items():
                for k in some:
                    found[k][number] = slot
    return found


def _are_joints(series: Sequence[Series], sets: Sequence[Mapping[str, list[int]]]) -> bool:
    """Whether numbered series are of joints: by a quantity of motion, or by their name."""
    some = [series[k] for each in sets for ours in each.values() for k in ours]
    return any(
        _quantity(each) in (POSITION, SPEED) or _JOINT_WORDS & set(_slots(each)) for each in some
    )


def _quantity(series: Series) -> str:
    place = series.place
    name = place.get("column") or f"{place['topic']}/{place['field']}"
    return words_of(name, place.get("type", "")).quantity


def _merged(sets: Sequence[set[str]]) -> list[set[str]]:
    """Sets that share a word are one."""
    found: list[set[str]] = []
    for each in sets:
        joined = set(each)
        apart = []
        for known in found:
            if known & joined:
                joined |= known
            else:
                apart.append(known)
        found = [*apart, joined]
    return found


def _scores(
    series: Sequence[Series], parts: Sequence[Mapping[int, str]]
) -> dict[tuple[str, ...], tuple[int, bool, float]]:
    """Groups that move -> quantities that change, whether a topic names it, and its motion."""
    most = max(map(len, parts), default=0)
    members: dict[tuple[str, ...], list[Series]] = defaultdict(list)
    for each, own in zip(series, parts, strict=True):
        if most and len(own) == most and each.changes:
            members[tuple(own[k] for k in sorted(own))].append(each)
    others = [each for each, own in zip(series, parts, strict=True) if not own]
    topics = frozenset(w for each in others for w in _words(each.place.get("topic", "")))
    found = {}
    for name, ours in members.items():
        kinds = {_quantity(each) for each in ours} - {OTHER, ""}
        told = bool(_words(_label(name)) & topics)
        found[name] = (len(kinds), told, _motion(ours))
    return found


def _motion(ours: Sequence[Series]) -> float:
    """Largest span of a position, or of anything, in decades, as far as joints differ by it."""
    places = [each for each in ours if _quantity(each) == POSITION] or list(ours)
    spans = [float(np.nanmax(each.readings) - np.nanmin(each.readings)) for each in places]
    return float(round(math.log10(max([*spans, 1e-12]))))


def _is_of_another(
    series: Series,
    own: Mapping[int, str],
    chosen: Sequence[str],
    names: Mapping[tuple[str, ...], object],
) -> bool:
    if own:
        return any(group not in chosen for group in own.values())
    mine = _words(_label(chosen))
    text = series.place.get("topic", "")
    words = _words(text)
    others = [_words(_label(name)) for name in names if name != tuple(chosen)]
    return not mine & words and any(each & words - mine for each in others)


def _words(text: str) -> frozenset[str]:
    return frozenset(_iter_words(text)) - _ANY


def _iter_words(text: str) -> Iterator[str]:
    yield from _WORDS.findall(text.lower())
