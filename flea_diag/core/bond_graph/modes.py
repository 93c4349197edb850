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

"""Modes of a machine that a channel tells: a brake, an enable, a trip, a gripper, a controller."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from flea_diag.core.bond_graph.bond_graph import BondGraph
from flea_diag.core.symbolic.unit import dimension
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import NotNegative


@dataclass(frozen=True)
class MachineMode:
    """The machine is in it while ``channel`` reads more than ``above`` and less than ``below``.

    Something then ``holds`` the flow of a junction, with an effort that nothing measures: its
    balances do not hold. Residuals that it ``voids`` do not, either; those of ``only`` hold in this
    mode and in no other. All of this lasts for ``settles_s`` after its end.
    """

    name: str
    channel: str
    above: float = math.nan
    below: float = math.nan
    unit: str = "1"
    holds: str = ""
    voids: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    settles_s: NotNegative = 0.0


def modes(
    rows: Mapping[str, Any],
    graph: BondGraph,
    units: Mapping[str, str],
    residuals: Collection[str],
    where: str,
) -> dict[str, MachineMode]:
    """Name -> mode, in the order of the description; ``units`` are those of sensors and inputs.

    Raises
    ------
    ConfigurationError
        Names the mode, and the limit, junction, residual or unit that is wrong.
    """
    found = {}
    for name, row in rows.items():
        place = f"{where}: mode {shown(name)}"
        mode = read_as(MachineMode, row, place, given={"name": name})
        _check_reading(mode, units.get(mode.channel, mode.unit), place)
        held = graph.elements.get(mode.holds)
        if mode.holds and (held is None or held.kind != "1"):
            raise ConfigurationError(
                f"{place}: holds {shown(mode.holds)}, which is no 1-junction; name that of the "
                "part that stands still then"
            )
        for residual in (*mode.voids, *mode.only):
            if residual not in residuals:
                raise ConfigurationError(
                    f"{place}: {shown(residual)} is no residual, known are {', '.join(residuals)}"
                )
        found[name] = mode
    return found


def _check_reading(mode: MachineMode, unit: str, place: str) -> None:
    if math.isnan(mode.above) and math.isnan(mode.below):
        raise ConfigurationError(
            f"{place}: {mode.channel} has no limit; say above or below which reading the machine "
            "is in this mode, as above: 0.5"
        )
    if mode.above >= mode.below:
        raise ConfigurationError(
            f"{place}: above = {mode.above:g} must be less than below = {mode.below:g}"
        )
    if dimension(mode.unit) != dimension(unit):
        raise ConfigurationError(
            f"{place}: {mode.channel} is in {shown(unit)}, not in {shown(mode.unit)}: give its unit"
        )
