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

"""What the channels of a recording say together of their units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import (
    CURRENT,
    LOAD,
    VOLTAGE,
    fitted,
    rate_of,
    sign_relations,
    smoothed,
)
from flea_diag.core.calibration.sign_check import roles_of
from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.tools.series.series_words import COMMANDED, POSITION, SPEED, words_of
from flea_diag.tools.stand_folder.channel_choice import ChosenChannel
from flea_diag.tools.stand_folder.unit_choice import UnitFactor, Units, factor_to_si

Array = npt.NDArray[np.float64]

LEAD_M, LEAD_SPREAD = 3.0e-3, 0.45
"""Way of the moved part for one turn of the motor, through gear and screw; spread in decades."""
ROUND_LEADS_MM = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 3.175, 4.0, 5.0, 6.0, 6.35, 8.0, 10.0, 12.7, 16.0)
EFFICIENCY_SPREAD = 0.12
"""Decades by which the work of the motor and that on the load may differ."""
SURE = 5.0
"""Certainty of a slope from which on it says something of units."""


def unit_relations(channels: Sequence[ChosenChannel], period_s: float) -> list[UnitFactor]:
    """Factors of several channels."""
    found = [*_of_speeds(channels, period_s), *_of_equals(channels)]
    found += _of_power(channels, period_s)
    return found


def _of_kind(channels: Sequence[ChosenChannel], *si: str) -> list[ChosenChannel]:
    return [each for each in channels if each.si_unit in si]


def _is_commanded(each: ChosenChannel) -> bool:
    return COMMANDED in words_of(each.channel).qualifiers


def _of_speeds(channels: Sequence[ChosenChannel], period_s: float) -> list[UnitFactor]:
    """A speed is the rate of a position, through a lead or a gear."""
    positions = [e for e in _of_kind(channels, "m", "rad") if not _is_commanded(e)]
    found = []
    for speed in _of_kind(channels, "m/s", "rad/s"):
        for position in positions[:1]:
            rate = rate_of(smoothed(position.source.values, period_s), period_s)
            ((slope, sure),) = fitted(smoothed(speed.source.values, period_s), [rate], 10.0)
            if abs(sure) > SURE:
                found.append(_speed_factor(speed.channel, position.channel, abs(slope)))
    return found


SELF = 0.02
"""Deviation from one up to which a speed is the rate of a position in its own unit."""
OF_ITSELF = 5.0


def _speed_factor(speed: str, position: str, slope: float) -> UnitFactor:
    of_itself = abs(slope - 1.0) < SELF

    def merit(units: Units) -> float:
        if of_itself and units[speed] == f"{units[position]}/s":
            return OF_ITSELF
        ratio = slope * factor_to_si(units[speed]) / factor_to_si(units[position])
        turning = [CONVERTED.get(u, (u,))[0] in ("rad", "rad/s") for u in
                   (units[speed], units[position])]  # fmt: skip
        if turning == [False, True]:
            return -20.0
        if turning[0] == turning[1]:
            # The part itself, or a motor before its gear.
            if abs(math.log(ratio)) < 0.03:
                return 3.0
            return -6.0 if not turning[0] or not 1.5 < ratio < 400.0 else -1.0
        lead_m = 2.0 * math.pi / ratio
        is_round = any(abs(1e3 * lead_m / lead - 1.0) < 0.004 for lead in ROUND_LEADS_MM)
        return 1.5 * is_round - 0.5 * (math.log10(lead_m / LEAD_M) / LEAD_SPREAD) ** 2

    words = f"it is the rate of {position}"
    return UnitFactor(
        (speed, position), merit, words if of_itself else f"{words} through a usual lead or gear"
    )


def _of_equals(channels: Sequence[ChosenChannel]) -> list[UnitFactor]:
    """Two readings of one quantity are equal but for their units."""
    found = []
    for number, one in enumerate(channels):
        for other in channels[number + 1 :]:
            if one.si_unit != other.si_unit or one.si_unit == "degC":
                continue
            ((slope, sure),) = fitted(one.source.values, [other.source.values], 50.0)
            if abs(sure) > 4.0 * SURE:
                found.append(_equal_factor(one.channel, other.channel, abs(slope)))
    return found


def _equal_factor(one: str, other: str, slope: float) -> UnitFactor:
    def merit(units: Units) -> float:
        ratio = slope * factor_to_si(units[one]) / factor_to_si(units[other])
        return 3.0 if abs(math.log(ratio)) < 0.15 else -3.0

    return UnitFactor((one, other), merit, "it must equal the other reading of its quantity")


def _of_power(channels: Sequence[ChosenChannel], period_s: float) -> list[UnitFactor]:
    """The back-EMF constant in V s/m is the force constant in N/A: power in is power out."""
    roles = roles_of({each.channel: each.si_unit for each in channels})
    if not {VOLTAGE, CURRENT, POSITION, LOAD} <= roles.keys():
        return []
    values = {each.channel: each.source.values for each in channels}
    signals: Mapping[str, Array] = {
        role: values[name] for role, name in roles.items() if role != SPEED
    }
    slopes = {
        (r.one, r.other): r.slope
        for r in sign_relations(signals, period_s)
        if abs(r.certainty) > SURE
    }
    emf, load = slopes.get((VOLTAGE, POSITION)), slopes.get((CURRENT, LOAD))
    if emf is None or load is None:
        return []
    product = abs(emf * load)

    def merit(units: Units) -> float:
        factor = {role: factor_to_si(units[name]) for role, name in roles.items()}
        ratio = product * factor[VOLTAGE] * factor[CURRENT] / factor[POSITION] / factor[LOAD]
        off = math.log10(ratio) / EFFICIENCY_SPREAD
        return -0.5 * min(off * off, 30.0)

    names = tuple(roles[role] for role in (POSITION, LOAD, VOLTAGE, CURRENT))
    return [UnitFactor(names, merit, "the power of the motor is the work on the load")]
