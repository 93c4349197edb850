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

"""The sign of each channel: against the first position, by the balance of power."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import (
    POSITION,
    SignRelation,
    fitted,
    sign_relations,
    turned,
)
from flea_diag.core.calibration.sign_check import roles_of
from flea_diag.tools.stand_folder.channel_choice import ChosenChannel

Array = npt.NDArray[np.float64]

SURE = 4.0
"""Certainty of a relation from which on it tells a sign."""
NEGATIVE = 0.02
"""Share of its span that a position that counts downwards may have above zero."""


@dataclass(frozen=True)
class SignGuess:
    """1 or -1, and why; not ``sure`` where nothing tells."""

    sign: int
    because: str
    sure: bool = True


def guessed_signs(channels: Sequence[ChosenChannel], period_s: float) -> dict[str, SignGuess]:
    """Sign of each channel, so that what is positive extends and a positive load opposes."""
    units = {each.channel: each.si_unit for each in channels}
    values = {each.channel: each.source.values for each in channels}
    roles = roles_of(units)
    found = {
        name: SignGuess(1, "a temperature has one sign") for name, u in units.items() if u == "degC"
    }
    if POSITION not in roles:
        return {name: found.get(name, SignGuess(1, _NO_POSITION, sure=False)) for name in units}
    origin = roles[POSITION]
    found[origin] = _of_position(values[origin])
    signals = {role: values[name] for role, name in roles.items()}
    signals[POSITION] = found[origin].sign * signals[POSITION]
    relations = [r for r in sign_relations(signals, period_s) if abs(r.certainty) > SURE]
    flipped = turned(relations, list(roles), fixed=(POSITION,))[0]
    for role, name in roles.items():
        if role != POSITION:
            found[name] = _by_balance(role, flipped, relations)
    for name in units:
        if name not in found:
            found[name] = _by_likeness(name, units, values, found, origin)
    return found


_NO_POSITION = "no position was recorded to tell it by"


def _of_position(values: Array) -> SignGuess:
    finite = values[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    if high < NEGATIVE * (high - low) and low < -0.3 * (high - low):
        return SignGuess(-1, "it counts downwards, and travel is positive")
    return SignGuess(1, "more of it is taken for extension", sure=False)


def _by_balance(role: str, flipped: frozenset[str], relations: Sequence[SignRelation]) -> SignGuess:
    """Sign of a signal, by the surest relation that holds it."""
    telling = [r for r in relations if role in (r.one, r.other)]
    if not telling:
        return SignGuess(1, "nothing in the recording tells it", sure=False)
    best = max(telling, key=lambda r: abs(r.certainty))
    # A defect of one channel leaves a relation that no choice of signs satisfies.
    kept = [((r.one in flipped) != (r.other in flipped)) == (r.slope < 0.0) for r in telling]
    return SignGuess(-1 if role in flipped else 1, f"{best.meaning} must be positive", all(kept))


def _by_likeness(
    name: str,
    units: Mapping[str, str],
    values: Mapping[str, Array],
    known: Mapping[str, SignGuess],
    origin: str,
) -> SignGuess:
    """Sign of a second reading, or of a command, by the reading that it is like."""
    alike = [n for n in known if units[n] == units[name] and units[n] != "degC"] or [origin]
    ((_, sure),) = fitted(values[name], [values[alike[0]]], 50.0)
    if abs(sure) < SURE:
        return SignGuess(1, "nothing in the recording tells it", sure=False)
    sign = known[alike[0]].sign * (1 if sure > 0.0 else -1)
    return SignGuess(sign, f"it goes with {alike[0]}")
