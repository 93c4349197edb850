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

"""Which series is which channel of a description: by quantity and by whose it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.tools.series.series_sum import SeriesSum
from flea_diag.tools.series.series_words import (
    COMMANDED,
    CURRENT,
    EFFORT,
    ERROR,
    FORCE,
    POSITION,
    SPEED,
    TORQUE,
    NameWords,
    quantity_of,
    words_of,
)

LEAST_MERIT, POOR_MERIT, GIVEN = 0.3, 0.65, 20.0
ALIKE_MERIT = 0.05
"""Difference in merit up to which two sources fit a channel equally."""
BY_NAME, BY_LIKENESS, BY_BEHAVIOUR = 0.95, 0.8, 0.6
"""Confidence in a source by its name, by another quantity that serves, by what it follows."""
OWNERS = ("nut", "ambient", "load", "surface")
"""Parts whose reading is never that of another part."""
ALIKE: Mapping[tuple[str, str], float] = {
    (FORCE, TORQUE): -0.4,
    (EFFORT, TORQUE): 0.0,
    (EFFORT, FORCE): -0.3,
    (EFFORT, CURRENT): -0.4,
    (TORQUE, CURRENT): -0.5,
}
"""Quantity of a series and of a channel that it may be all the same -> what that costs."""


@dataclass(frozen=True, eq=False)
class ChosenChannel:
    """A channel with its source.

    ``merit`` is that of the choice, ``because`` its reason, ``confidence`` the chance that it is
    right, 0 to 1; ``rivals`` are sources that would do as well. ``unit`` is given; "" to be found.
    """

    channel: str
    si_unit: str
    source: SeriesSum
    merit: float
    because: str
    confidence: float = 1.0
    rivals: tuple[str, ...] = ()
    unit: str = ""


@dataclass(frozen=True)
class GivenChannel:
    """A channel whose source the user names, and its unit; "" to be found."""

    source: str
    unit: str = ""


def chosen_channels(
    sources: Sequence[SeriesSum],
    units: Mapping[str, str],
    given: Mapping[str, GivenChannel] = MappingProxyType({}),
) -> tuple[ChosenChannel, ...]:
    """Channels of a description with the sources that fit best, one source for each.

    Parameters
    ----------
    sources
        Series of the recording.
    units
        SI unit of each channel of the description.
    given
        Channels whose sources are known.
    """
    from scipy.optimize import linear_sum_assignment

    names = list(units)
    merits = np.array([[merit_of(s, name, units[name]) for name in names] for s in sources])
    for name, own in given.items():
        if name in names:
            merits[:, names.index(name)] = -10.0
            for row in _rows_of(sources, own.source):
                merits[row, :] = -10.0
                merits[row, names.index(name)] = GIVEN
    # A little for those named first, so that a bare "position" is the first position.
    order = -0.01 * np.arange(len(names))
    rows, columns = linear_sum_assignment(merits + order, maximize=True)
    taken = {row: c for row, c in zip(rows, columns, strict=True) if merits[row, c] >= LEAST_MERIT}
    found = []
    for row, column in taken.items():
        name, source, merit = names[column], sources[row], float(merits[row, column])
        if name in given:
            found.append(
                ChosenChannel(name, units[name], source, merit, "you say so", unit=given[name].unit)
            )
            continue
        rivals = tuple(
            sources[other].name
            for other in range(len(sources))
            if other not in taken and merits[other, column] > merit - ALIKE_MERIT
        )
        sure = _confidence(source, units[name], merit) / (1.0 + len(rivals))
        because = _because(source, name, units[name])
        found.append(ChosenChannel(name, units[name], source, merit, because, sure, rivals))
    return tuple(sorted(found, key=lambda each: names.index(each.channel)))


def _rows_of(sources: Sequence[SeriesSum], name: str) -> list[int]:
    """Places of the sources of this name."""
    return [k for k, each in enumerate(sources) if name in (each.name, each.terms[0][0].words)][:1]


def _confidence(source: SeriesSum, si_unit: str, merit: float) -> float:
    """The chance that a source without a rival is the channel."""
    if source.because:
        return BY_BEHAVIOUR
    quantity = source.words.quantity
    if quantity != quantity_of(si_unit):
        return BY_LIKENESS
    return BY_NAME if merit >= POOR_MERIT else BY_LIKENESS


def merit_of(source: SeriesSum, channel: str, si_unit: str) -> float:
    """How well a source fits a channel; below ``LEAST_MERIT`` not at all."""
    own, wanted = source.words, words_of(channel)
    same = _same_quantity(own, quantity_of(si_unit), si_unit)
    commanded = COMMANDED in own.qualifiers
    if same is None or ERROR in own.qualifiers or commanded != (COMMANDED in wanted.qualifiers):
        return -10.0
    merit = 1.0 + same + 2.0 * len((own.qualifiers & wanted.qualifiers) - {COMMANDED})
    for word in own.qualifiers - wanted.qualifiers:
        foreign = bool(wanted.qualifiers & {"nut", "ambient", "surface"})
        merit -= 2.5 if word in OWNERS else (2.0 if foreign else 0.2)
    for word in wanted.qualifiers - own.qualifiers:
        merit -= 0.4 if word in OWNERS else 0.1
    is_named = channel in source.name.lower()
    return merit + (3.0 if is_named else 0.0)


def _same_quantity(own: NameWords, quantity: str, si_unit: str) -> float | None:
    """What it costs to take a series for a channel of this quantity; None: it is none."""
    unit = own.unit or own.typed
    si = CONVERTED[unit][0] if unit in CONVERTED else unit
    if own.quantity != quantity:
        stands_for = own.quantity in (TORQUE, EFFORT) and quantity == CURRENT
        if own.unit and quantity_of(own.unit) != quantity and not stands_for:
            return None
        return ALIKE.get((own.quantity, quantity))
    if not si or si == si_unit:
        return 0.0
    if quantity == SPEED:
        return -0.3  # of the moved part instead of the motor, or the other way about
    if quantity == POSITION and not own.unit:
        return -0.3  # a JointState of a part that slides
    return None


def _because(source: SeriesSum, channel: str, si_unit: str) -> str:
    words = source.words
    said = " ".join(sorted(words.qualifiers - {COMMANDED}))
    if len(source.terms) > 1:
        return "set point and error of the position loop are one"
    if source.because:
        return source.because
    if channel in source.name.lower():
        return "it has its name"
    if COMMANDED in words.qualifiers and "load" in channel:
        return "a load that stands still between changes is commanded"
    if words.quantity == TORQUE and quantity_of(si_unit) == CURRENT:
        return "no current was recorded, the torque goes with it"
    if words.quantity == EFFORT:
        return "the description has no other effort"
    return f"its name says {f'{said} {words.quantity}'.strip()}"
