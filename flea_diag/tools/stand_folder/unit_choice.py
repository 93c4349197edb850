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

"""The unit of each channel: by its name, by its size, and by what the channels say together.

Each piece of evidence is a factor: a logarithmic merit of one choice of units. The choice with the
largest sum wins; the factor that speaks most against the next best unit is its reason.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.tools.series.series_words import CURRENT, TORQUE, quantity_of
from flea_diag.tools.stand_folder.channel_choice import ChosenChannel

Units = Mapping[str, str]

CANDIDATES: dict[str, dict[str, float]] = {
    "m": {"m": 0.0, "mm": 0.0, "in": -0.5, "cm": -1.5},
    "rad": {"rad": 0.0, "deg": 0.0, "rev": -2.0},
    "m/s": {"m/s": 0.0, "mm/s": 0.0, "in/s": -0.5},
    "rad/s": {
        "rad/s": 0.0,
        "rpm": 0.0,
        "deg/s": -1.0,
        "rev/s": -1.0,
        "m/s": -0.5,
        "mm/s": -0.5,
        "in/s": -0.9,
    },
    "A": {"A": 0.0, "mA": 0.0},
    "V": {"V": 0.0, "mV": -0.5},
    "N": {"N": 0.0, "lbf": -0.3, "kgf": -0.5, "kN": -0.3},
    "N*m": {"N*m": 0.0, "mN*m": -0.7, "lbf*in": -0.7, "lbf*ft": -0.7, "kgf*cm": -1.0},
    "degC": {"degC": 0.0, "degF": -0.7, "K": -0.3},
}
"""SI unit -> units that people send it in, with how seldom they do."""
TYPICAL: dict[str, tuple[float, float]] = {
    "m": (0.08, 0.6), "rad": (2.0, 0.5), "m/s": (0.03, 0.7), "rad/s": (100.0, 0.7),
    "A": (3.0, 0.7), "V": (20.0, 0.5), "N": (500.0, 0.9), "N*m": (10.0, 0.8),
}  # fmt: skip
"""SI unit -> usual size of such a signal on a stand, and its spread in decades."""
TYPICAL_DEGC = (25.0, 12.0)
"""Lowest reading of a temperature, and its spread in kelvin."""
BY_TYPE, IN_A_BAG = 3.0, 0.7
"""Merit of the unit by a message's definition, and of an SI unit on a topic (REP-103)."""
COMMONEST, USUAL_SIZE = "it is the commonest unit", "its readings are of a usual size in it"
BY_SIZE = 0.7
"""Most confidence in a unit that nothing but the size of the readings tells."""
STANDS_FOR = {"N*m": "A", "mN*m": "mA", "": "A"}
"""Unit of a torque -> that of the current that it stands for."""
SURE = 2.0
"""Lead in merit over the next unit from which on a choice counts as sure."""
MOST_CHOICES = 200_000


@dataclass(frozen=True)
class UnitFactor:
    """Evidence on the units of some channels.

    Parameters
    ----------
    channels
        Those that it concerns.
    merit
        Of a choice of their units, as the logarithm of a likelihood.
    words
        What it rests on.
    """

    channels: tuple[str, ...]
    merit: Callable[[Units], float]
    words: str


@dataclass(frozen=True)
class UnitGuess:
    """The unit of one channel, and why.

    ``other`` is the next best, "" where it is far behind; ``confidence`` the chance that it is
    right, 0 to 1.
    """

    unit: str
    because: str
    other: str = ""
    confidence: float = 0.99

    @property
    def by_size(self) -> bool:
        """Whether nothing but the size of the readings tells it."""
        return self.because in (COMMONEST, USUAL_SIZE)


def factor_to_si(unit: str) -> float:
    """What readings in this unit are multiplied by; offsets of temperatures aside."""
    return CONVERTED[unit][1] if unit in CONVERTED else 1.0


def guessed_units(
    channels: Sequence[ChosenChannel], relations: Sequence[UnitFactor], is_bag: bool
) -> dict[str, UnitGuess]:
    """Unit of each channel; ``relations`` are factors of several channels."""
    options = {each.channel: _options(each) for each in channels}
    factors = [*(f for each in channels for f in _own_factors(each, is_bag)), *relations]
    found: dict[str, UnitGuess] = {}
    for group in _groups(list(options), factors):
        ours = [f for f in factors if f.channels[0] in group]
        found |= _solved({name: options[name] for name in group}, ours)
    for each in channels:
        if each.unit:
            found[each.channel] = UnitGuess(each.unit, "you say so")
        elif is_stand_in(each):
            unit = STANDS_FOR.get(each.source.words.unit, "A")
            words = "the torque stands for the current, which a calibration scales"
            found[each.channel] = UnitGuess(unit, words, confidence=0.9)
        elif each.source.words.unit:
            found[each.channel] = UnitGuess(each.source.words.unit, "its name says so")
    return found


def is_stand_in(each: ChosenChannel) -> bool:
    """Whether a torque stands for the current."""
    return each.source.words.quantity == TORQUE and quantity_of(each.si_unit) == CURRENT


def _options(each: ChosenChannel) -> tuple[str, ...]:
    unit = each.unit or each.source.words.unit
    if is_stand_in(each):
        unit = STANDS_FOR.get(unit, "A")
    return (unit,) if unit else tuple(CANDIDATES.get(each.si_unit, {each.si_unit: 0.0}))


def _own_factors(each: ChosenChannel, is_bag: bool) -> list[UnitFactor]:
    """What a channel says of its own unit."""
    name, si, typed = each.channel, each.si_unit, each.source.words.typed
    if typed == si:
        # What the message is defined to hold is no matter of size.
        own = [
            UnitFactor(
                (name,), lambda units: BY_TYPE * (units[name] == typed), "the message is defined so"
            )
        ]
        if si == "degC":  # but no room is at 78 or at 298 of them
            own.append(
                UnitFactor((name,), lambda units: _size_merit(each, units[name]), USUAL_SIZE)
            )
        return own
    seldom = CANDIDATES.get(si, {})
    own = [
        UnitFactor((name,), lambda units: seldom.get(units[name], 0.0), COMMONEST),
        UnitFactor(
            (name,),
            lambda units: _size_merit(each, units[name]),
            USUAL_SIZE,
        ),
    ]
    if is_bag:
        words = "topics are in SI by convention"
        own.append(UnitFactor((name,), lambda units: IN_A_BAG * (units[name] == si), words))
    if typed and quantity_of(typed) == quantity_of(si):
        words = "the message is defined so"
        own.append(UnitFactor((name,), lambda units: BY_TYPE * (units[name] == typed), words))
    return own


def _size_merit(each: ChosenChannel, unit: str) -> float:
    """How usual readings of this size are in a unit."""
    finite = each.source.values[np.isfinite(each.source.values)]
    low, high = (float(x) for x in np.quantile(finite, [0.02, 0.98]))
    si, factor, offset = CONVERTED.get(unit, (unit, 1.0, 0.0))
    if si == "degC":
        usual, spread = TYPICAL_DEGC
        return -0.5 * ((factor * low + offset - usual) / spread) ** 2
    size = high - low if quantity_of(si) == "position" else max(abs(low), abs(high))
    usual, spread = TYPICAL.get(si, (1.0, 3.0))
    return -0.5 * (math.log10(max(factor * size, 1e-9) / usual) / spread) ** 2


def _groups(names: Sequence[str], factors: Sequence[UnitFactor]) -> list[list[str]]:
    """Channels that factors tie together."""
    group = {name: {name} for name in names}
    for factor in factors:
        joined = set().union(*(group[name] for name in factor.channels))
        for name in joined:
            group[name] = joined
    unique = {id(each): each for each in group.values()}
    return [[name for name in names if name in each] for each in unique.values()]


def _solved(
    options: Mapping[str, tuple[str, ...]], factors: Sequence[UnitFactor]
) -> dict[str, UnitGuess]:
    """Units of channels that belong together."""
    names = list(options)
    count = math.prod(len(each) for each in options.values())
    if count > MOST_CHOICES:
        factors = [factor for factor in factors if len(factor.channels) == 1]
        return {
            name: _solved({name: options[name]}, [f for f in factors if f.channels == (name,)])[
                name
            ]
            for name in names
        }
    ranked = [
        (sum(f.merit(units) for f in factors), units)
        for choice in itertools.product(*options.values())
        if (units := dict(zip(names, choice, strict=True)))
    ]
    merit, best = max(ranked, key=lambda row: row[0])
    found = {}
    for name in names:
        others = [row for row in ranked if row[1][name] != best[name]]
        if not others:
            found[name] = UnitGuess(best[name], "there is no other")
            continue
        next_merit, other = max(others, key=lambda row: row[0])
        reason = max(factors, key=lambda f: f.merit(best) - f.merit(other))
        lead = merit - next_merit
        sure = 1.0 / (1.0 + math.exp(-min(lead, 5.0)))
        by_size = reason.words in (COMMONEST, USUAL_SIZE)
        doubt = other[name] if lead < SURE or by_size else ""
        sure = min(sure, BY_SIZE) if by_size else sure
        found[name] = UnitGuess(best[name], reason.words, doubt, sure)
    return found
