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

"""How good forecasts of an end of life were, once it is known.

After Saxena, Celaya, Saha, Saha and Goebel, "Metrics for offline evaluation of prognostic
performance", International Journal of Prognostics and Health Management 1 (2010). The remaining
life at time t is ``end - t``; a forecast made at t has a median and an interval of the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Foretold:
    """One forecast: when it was made, and the 5, 50 and 95 % quantiles of the end, all in s."""

    made_s: float
    low_s: float
    median_s: float
    high_s: float

    def covers(self, end_s: float) -> bool:
        """Whether the end lies within its interval of 90 %."""
        return self.low_s <= end_s <= self.high_s

    def is_within(self, end_s: float, alpha: float) -> bool:
        """Whether its remaining life is right to a share ``alpha`` of the true one."""
        return abs(self.median_s - end_s) <= alpha * (end_s - self.made_s)


def at_lambda(
    made: Sequence[Foretold], first_s: float, end_s: float, share: float
) -> Foretold | None:
    """The last forecast up to a share lambda of the way from ``first_s`` to the end; None: none."""
    until_s = first_s + share * (end_s - first_s)
    return max((f for f in made if f.made_s <= until_s), key=lambda f: f.made_s, default=None)


def horizon_s(made: Sequence[Foretold], end_s: float, alpha: float, life_s: float) -> float:
    """Prognostic horizon: how long before the end forecasts become right, and stay so.

    Right is to a share ``alpha`` of a whole life; 0 where the last one is not.
    """
    right_s = 0.0
    for each in sorted(made, key=lambda f: f.made_s, reverse=True):
        if abs(each.median_s - end_s) > alpha * life_s:
            break
        right_s = end_s - each.made_s
    return right_s
