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

"""Travel of the moved part of an actuator: where its hard stops are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from flea_diag.core.bond_graph.bond_graph import BondGraph
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as

WITHIN = 0.02
"""Share of the travel that counts as its end, unless stated: homing errors, give of the stop."""


@dataclass(frozen=True)
class Travel:
    """Ends of travel of the part that moves with the flow of junction ``at``, m.

    A hard stop holds the part within ``within_m`` of an end, and pushes it back from there.
    """

    at: str
    low_m: float
    high_m: float
    within_m: float = math.nan


def travel(
    content: Mapping[str, Any], graph: BondGraph, displaced: Iterable[str], where: str
) -> Travel | None:
    """From its description; None where there is none. ``displaced`` has a displacement sensor.

    Raises
    ------
    ConfigurationError
        No such 1-junction, no displacement read there, or ends in the wrong order.
    """
    if not content:
        return None
    place = f"{where}: travel"
    known = read_as(Travel, content, place)
    at, low, high = known.at, known.low_m, known.high_m
    if at not in graph.elements or graph.elements[at].kind != "1":
        raise ConfigurationError(
            f"{place}: at = {shown(at)} is no 1-junction; name that of the moved part"
        )
    if at not in displaced:
        raise ConfigurationError(
            f"{place}: at = {shown(at)}, where no sensor reads a displacement; name a junction "
            "with one, for an end is recognised by its position"
        )
    if not low < high:
        raise ConfigurationError(f"{place}: low_m = {low:g} must be below high_m = {high:g}")
    within = WITHIN * (high - low) if math.isnan(known.within_m) else known.within_m
    if not 0.0 < within < 0.5 * (high - low):
        raise ConfigurationError(
            f"{place}: within_m = {within:g} must be above 0 and below half of the travel, "
            f"{0.5 * (high - low):g}"
        )
    return Travel(at, low, high, within)
