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

"""Groups of faults with probabilities, and their update by one answer (Bayes)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from flea_diag.core.choice.feature_table import FaultFeatureTable

Group = Mapping[str, float]
"""Faults still possible, each with its probability."""

DROP_BELOW = 0.01
"""A fault whose probability falls below this is dropped permanently."""


def normalised(group: Group) -> dict[str, float]:
    """Group whose probabilities sum to 1, by name."""
    total = math.fsum(group.values())
    return {fault: group[fault] / total for fault in sorted(group)} if total > 0.0 else {}


def refine(
    group: Group,
    table: FaultFeatureTable,
    feature: str,
    symbol: str,
    drop_below: float = DROP_BELOW,
) -> dict[str, float]:
    """Group after one answer: Bayes with P(symbol | fault), then improbable faults are dropped.

    Never grows. Empty if no fault of the group can give this symbol; unchanged by ``?``.
    """
    if symbol == "?":
        return normalised(group)
    place = table.place(symbol)
    return without_improbable(
        {fault: p * table.probabilities(fault, feature)[place] for fault, p in group.items()},
        drop_below,
    )


def refine_side(
    group: Group, table: FaultFeatureTable, feature: str, side: str
) -> dict[str, float]:
    """Group after a feature was above its range (``+``) or below (``-``) by any amount."""
    places = {table.place(side), table.place(2 * side)}
    rows = {fault: table.probabilities(fault, feature) for fault in group}
    joint = {fault: p * sum(rows[fault][k] for k in places) for fault, p in group.items()}
    return without_improbable(joint)


def without_improbable(joint: Group, drop_below: float = DROP_BELOW) -> dict[str, float]:
    """Posterior of joint probabilities, without those below the limit."""
    posterior = normalised(joint)
    left = {fault: p for fault, p in posterior.items() if p >= drop_below and p > 0.0}
    return posterior if len(left) == len(posterior) else normalised(left)


def outcomes(
    group: Group,
    table: FaultFeatureTable,
    feature: str,
    drop_below: float = DROP_BELOW,
    rarest: float = 0.0,
) -> dict[str, tuple[float, dict[str, float]]]:
    """Symbol -> (probability, remaining group), for symbols more probable than ``rarest``.

    The probabilities of ``group`` must sum to 1.
    """
    rows = [(fault, p, table.probabilities(fault, feature)) for fault, p in group.items()]
    found: dict[str, tuple[float, dict[str, float]]] = {}
    for place, symbol in enumerate(table.alphabet):
        joint = {fault: p * row[place] for fault, p, row in rows}
        total = sum(joint.values())
        if total > rarest:
            found[symbol] = total, without_improbable(joint, drop_below)
    return found


def entropy(group: Group) -> float:
    """Shannon entropy of a group in bits."""
    return -math.fsum(p * math.log2(p) for p in normalised(group).values() if p > 0.0)
