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

"""What the features of one window say of a group of faults, and the bound of it."""

from __future__ import annotations

from flea_diag.core.choice.fault_group import Group, normalised, without_improbable
from flea_diag.core.choice.feature_table import FaultFeatureTable


class WindowOdds:
    """Odds of the faults by the features of one window, relative to the most probable one.

    They are no smaller than the ``window_error`` of the table, so that a fault is dropped by
    windows that agree, not by features of one window that depend on each other.
    """

    def __init__(self) -> None:
        self._odds: dict[str, float] = {}

    def begin(self) -> None:
        """What follows is of another window."""
        self._odds = {}

    def after(
        self, group: Group, table: FaultFeatureTable, feature: str, symbol: str
    ) -> dict[str, float]:
        """Group after one more answer: Bayes within the bound, then improbable faults are dropped.

        Never grows. Empty if no fault of the group can give this symbol; unchanged by ``?``.
        """
        if symbol == "?":
            return normalised(group)
        place, before = table.place(symbol), self._bounded(group, table)
        joint = {
            fault: self._odds.get(fault, 1.0) * table.probabilities(fault, feature)[place]
            for fault in group
        }
        most = max(joint.values(), default=0.0)
        if most <= 0.0:
            return {}
        self._odds = {fault: odds / most for fault, odds in joint.items()}
        now = self._bounded(group, table)
        return without_improbable(
            {fault: p * now[fault] / was for fault, p in group.items() if (was := before[fault])}
        )

    def unbounded(self, group: Group, table: FaultFeatureTable) -> dict[str, float]:
        """The group as this window alone would have it: what further features of it can split."""
        bounded = self._bounded(group, table)
        return without_improbable(
            {
                fault: p * self._odds.get(fault, 1.0) / bounded[fault]
                for fault, p in group.items()
                if bounded[fault]
            }
        )

    def _bounded(self, group: Group, table: FaultFeatureTable) -> dict[str, float]:
        odds = {fault: self._odds.get(fault, 1.0) for fault in group}
        best = max(odds, key=odds.__getitem__, default="")
        return {
            fault: max(each, table.window_error.get((fault, best), 0.0))
            for fault, each in odds.items()
        }
