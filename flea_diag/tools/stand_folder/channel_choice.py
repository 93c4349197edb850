"""Which series is which channel of a description: by quantity and by whose it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.tools.stand_folder.reading_grid import SeriesSum
from flea_diag.tools.stand_folder.series_words import (
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

LEAST_MERIT = 0.3
OWNERS = ("nut", "ambient", "load", "surface")
"""Parts whose reading is never that of another part."""
ALIKE: Mapping[tuple[str, str], float] = {
    (FORCE, TORQUE): -0.4,
    (TORQUE, FORCE): -0.4,
    (EFFORT, TORQUE): 0.0,
    (EFFORT, FORCE): -0.3,
    (EFFORT, CURRENT): -0.4,
}
"""Quantity of a series and of a channel that it may be all the same -> what that costs."""


@dataclass(frozen=True, eq=False)
class ChosenChannel:
    """A channel with its source; ``merit`` is that of the choice, ``because`` its reason."""

    channel: str
    si_unit: str
    source: SeriesSum
    merit: float
    because: str


def chosen_channels(
    sources: Sequence[SeriesSum], units: Mapping[str, str]
) -> tuple[ChosenChannel, ...]:
    """Channels of a description with the sources that fit best, one source for each.

    Parameters
    ----------
    sources
        Series of the recording.
    units
        SI unit of each channel of the description.
    """
    from scipy.optimize import linear_sum_assignment

    names = list(units)
    merits = np.array([[merit_of(s, name, units[name]) for name in names] for s in sources])
    # A little for those named first, so that a bare "position" is the first position.
    order = -0.01 * np.arange(len(names))
    rows, columns = linear_sum_assignment(merits + order, maximize=True)
    found = [
        ChosenChannel(
            names[column],
            units[names[column]],
            sources[row],
            float(merits[row, column]),
            _because(sources[row], names[column]),
        )
        for row, column in zip(rows, columns, strict=True)
        if merits[row, column] >= LEAST_MERIT
    ]
    return tuple(sorted(found, key=lambda each: names.index(each.channel)))


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
        if own.unit and quantity_of(own.unit) != quantity:
            return None
        return ALIKE.get((own.quantity, quantity))
    if not si or si == si_unit:
        return 0.0
    if quantity == SPEED:
        return -0.3  # of the moved part instead of the motor, or the other way about
    if quantity == POSITION and not own.unit:
        return -0.3  # a JointState of a part that slides
    return None


def _because(source: SeriesSum, channel: str) -> str:
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
    if words.quantity == EFFORT:
        return "the description has no other effort"
    return f"its name says {f'{said} {words.quantity}'.strip()}"
