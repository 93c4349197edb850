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

"""Signs of the channels of a stand, held against the balance of power before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import (
    CURRENT,
    LOAD,
    POSITION,
    SPEED,
    VOLTAGE,
    SignRelation,
    sign_relations,
    turned,
)

UNITS: Mapping[str, tuple[str, ...]] = {
    CURRENT: ("A",),
    VOLTAGE: ("V",),
    POSITION: ("m", "rad"),
    SPEED: ("rad/s", "m/s"),
    LOAD: ("N", "N*m"),
}
COMMANDED = "commanded_"
SUPPLIED = ("bus_", "battery_", "supply_")
"""First parts of the names of what a supply is read by: its voltage is not that of a motor."""
TELLING, CERTAIN = 4.0, 8.0
"""Standard errors by which coefficients of the balance must be below 0, and the surest of them,
for a sign to be wrong."""


def roles_of(units: Mapping[str, str]) -> dict[str, str]:
    """Role -> channel, of channels with these SI units in the order of the description.

    A load that is only commanded stands for the measured one; other commands have no role.
    """
    found: dict[str, str] = {}
    own = {name: unit for name, unit in units.items() if not name.startswith(SUPPLIED)}
    for role, fitting in UNITS.items():
        names = [name for name, unit in own.items() if unit in fitting]
        measured = [name for name in names if not name.startswith(COMMANDED)]
        chosen = measured or (names if role == LOAD else [])
        if chosen:
            found[role] = chosen[0]
    return found


def sign_contradiction(
    units: Mapping[str, str], values: npt.NDArray[np.float64], period_s: float
) -> str:
    """What the balance of power says against the signs of channels; "" if nothing.

    Parameters
    ----------
    units
        SI unit of each channel, in the order of the columns.
    values
        Readings in SI, shape (scans, channels); a row of NaN parts two recordings.
    period_s
        Time between two scans.
    """
    names, roles = list(units), roles_of(units)
    signals = {role: values[:, names.index(name)] for role, name in roles.items()}
    relations = sign_relations(signals, period_s)
    choices = [some for some in turned(relations, list(roles)) if _is_certain(relations, some)]
    if not choices:
        return ""
    worst = min(relations, key=lambda relation: relation.certainty)
    named = " or ".join(" and ".join(sorted(roles[role] for role in some)) for some in choices)
    return (
        f"{named}: {worst.meaning} is {worst.slope:.3g} ({worst.certainty:.0f} standard errors), "
        "by the balance of power it must be above 0: correct its sign"
    )


def _is_certain(relations: Sequence[SignRelation], flipped: frozenset[str]) -> bool:
    """Whether the relations that these signals turn contradict them, two if there are two.

    A defect of one channel turns one relation; a sign turns all that hold it.
    """
    ours = sorted(r.certainty for r in relations if (r.one in flipped) != (r.other in flipped))
    told = sum(certainty < -TELLING for certainty in ours)
    return told >= min(2, max(1, len(ours))) and ours[0] < -CERTAIN and ours[-1] < 0.5 * TELLING
