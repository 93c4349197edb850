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

"""Values of the actuator that a recording shows at once: what a data sheet should agree with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from flea_diag.core.calibration.power_balance import (
    CURRENT,
    LOAD,
    POSITION,
    SPEED,
    VOLTAGE,
    sign_relations,
)
from flea_diag.core.calibration.sign_check import roles_of
from flea_diag.tools.stand_folder.proposal import in_si

if TYPE_CHECKING:
    from flea_diag.tools.stand_folder.proposal import StandProposal

SURE = 10.0
"""Certainty of a coefficient that is worth telling."""


def seen_values(found: StandProposal) -> tuple[str, ...]:
    """A line for each."""
    units = {name: found.template.units[name] for name in (e.channel for e in found.channels)}
    roles = roles_of(units)
    values = {e.channel: in_si(e.source.values, e.unit, e.sign * e.scale) for e in found.channels}
    signals = {role: values[name] for role, name in roles.items()}
    slopes = {
        (r.one, r.other): r.slope
        for r in sign_relations(signals, found.grid.period_s)
        if r.certainty > SURE
    }
    turning = units.get(roles.get(POSITION, ""), "") == "rad"
    return tuple(_lines(slopes, turning, units.get(roles.get(SPEED, ""), "")))


def _lines(slopes: dict[tuple[str, str], float], turning: bool, speed: str) -> Iterator[str]:
    ratio = slopes.get((SPEED, POSITION))
    if ratio and speed == "rad/s":
        yield (
            f"{ratio:.4g} turns of the motor for one of the joint"
            if turning
            else f"{2e3 * math.pi / ratio:.4g} mm for one turn of the motor"
        )
    emf, resistance = slopes.get((VOLTAGE, POSITION)), slopes.get((VOLTAGE, CURRENT))
    if emf and resistance:
        yield f"winding {resistance:.3g} ohm, back-EMF {emf:.3g} V s/{'rad' if turning else 'm'}"
    work = slopes.get((CURRENT, LOAD))
    if work:
        yield f"{1.0 / work:.3g} {'N m' if turning else 'N'} of load for one ampere"
    supply = slopes.get((LOAD, POSITION))
    if supply:
        yield f"a supply of {1.0 / supply:.3g} V, by the power that the load takes"
