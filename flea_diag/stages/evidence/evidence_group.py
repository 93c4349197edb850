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

"""The group of an episode: faults whose share of the evidence has never fallen below a limit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

COVERAGE = 0.99
"""Share of true faults that their group holds: what falls below the rest is dropped for good."""
INEXACT = 0.01
"""Share of the evidence of the best fault that parts no two: no model of a fault is exact, and an
effect that is 10 % off as long as it is seen costs so much of what it explains."""
TOLD_WINDOWS = 10
"""Windows since the onset, without those about it, after which evidence counts in full: 2 s, in
which a motion has seen more than one load."""


def patience(windows: float) -> float:
    """By how much more evidence must part two explanations, since so few windows."""
    return max(1.0, TOLD_WINDOWS / max(windows, 1.0))


@dataclass
class EvidenceGroup:
    """Members by their share, and the faults that were dropped, each with its share by then."""

    dropped: dict[str, float] = field(default_factory=dict)
    shares: dict[str, float] = field(default_factory=dict)

    def take(self, nats: Mapping[str, float], windows: float) -> None:
        """Weigh the members once more; evidence of every fault in nats, since so many windows."""
        limit = (1.0 - COVERAGE) ** patience(windows)
        left = {fault: value for fault, value in nats.items() if fault not in self.dropped}
        while True:
            most = max(left.values())
            whole = math.fsum(math.exp(value - most) for value in left.values())
            shares = {fault: math.exp(value - most) / whole for fault, value in left.items()}
            least = min(shares, key=lambda fault: shares[fault])
            if shares[least] >= limit or most - left[least] < INEXACT * most:
                break
            self.dropped[least] = shares[least]
            del left[least]
        self.shares = dict(sorted(shares.items(), key=lambda entry: (-entry[1], entry[0])))
