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

"""What runs have shown that a calibration was not made from: nominal ones, and faulty ones.

Nominal recordings are judged by limits learned without them. Faulty runs give the coverage of the
ambiguity group by split conformal prediction. The score of a faulty run is the smallest limit on
the gap of log-likelihood at which the true fault stays in its group; there is none where symbols or
features rule it out. With the scores of n runs that nothing was tuned on, the limit

    q = the ceil((n + 1) coverage)-th smallest score

keeps the true fault of one more run with at least that probability if that run and the n are
exchangeable (Papadopoulos et al. 2002; Vovk et al. 2005). Runs that are drawn alike are; a
fault, a machine or a motion that the n do not have is not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flea_diag.fields.values import Count, NotNegative, Positive


@dataclass(frozen=True, slots=True)
class OutOfSample:
    """How near recordings came to a false alarm, by limits learned without them.

    ``largest`` is the largest statistic over its limit, ``alarms`` the number of recordings at 1 or
    beyond, ``widening`` the largest factor of a limit that the tail of its scores asked for.
    """

    recordings: Count
    alarms: Count
    largest: NotNegative
    widening: Positive


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A recording that was given as nominal and that the others show not to be."""

    recording: str
    reason: str


@dataclass(frozen=True, slots=True)
class GroupCoverage:
    """Scores of faulty runs in nats, ascending.

    ``lost``: runs whose fault no limit would have kept. ``missed``: runs without an alarm, which
    have no group and do not count. ``campaign``: what the runs were drawn by.
    """

    campaign: str
    nats: tuple[Positive, ...]
    lost: Count = 0
    missed: Count = 0

    @property
    def runs(self) -> int:
        """Runs with a group."""
        return len(self.nats) + self.lost

    @property
    def most(self) -> float:
        """Largest coverage that a limit gives."""
        return len(self.nats) / (self.runs + 1)

    def limit_nats(self, coverage: float) -> float:
        """Gap beyond which a fault may be dropped; infinity where no gap gives this coverage."""
        place = math.ceil((self.runs + 1) * coverage - 1e-9)
        return self.nats[place - 1] if 1 <= place <= len(self.nats) else math.inf
