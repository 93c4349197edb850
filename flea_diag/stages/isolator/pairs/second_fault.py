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

"""A second fault in an episode: whether one is suspected, since when, and which pairs explain both.

Suspected where no single fault is left, where those that are left leave more than noise, in the
whole episode or in its last seconds, and where a symbol contradicts a settled group. Otherwise
pairs are searched where a second fault may add enough to those that are left, in all the evidence
or since some time: an episode that one fault explains costs a system for each of these now and
then, and one fit of its last seconds every two.

A fault that begins later is in a part of the evidence only. So the sums of the episode are kept as
they were every two seconds; their difference is the evidence since, in which both are throughout.
Of those long ago ever fewer are kept.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.isolation.fault_pairs import FaultPair
from flea_diag.core.isolation.goodness_of_fit import Misfit
from flea_diag.core.likelihood.evidence_sums import EvidenceSums
from flea_diag.core.likelihood.fit import Fit
from flea_diag.wire import records as record

Array = npt.NDArray[np.float64]

LOOK_EVERY = 4
"""Evaluations from one look to the next."""
RECENT_LOOKS = 3
"""Looks that the last seconds go back by: 6 s, in which a motion goes both ways."""
SPACED = 4
"""From one to the next it is about half of that: a fault that began in between is in half of the
evidence at least."""
MOST_WAITED = 4
"""Most looks from one search to the next: the evidence grows by less and less of itself."""


@dataclass(frozen=True, eq=False)
class Look:
    """Sums of an episode, and scans in motion, as they were when."""

    stamp_ns: int
    sums: EvidenceSums
    motion: Array


@dataclass
class SecondFault:
    """What is known of a second fault in an episode.

    Attributes
    ----------
    looks
        The last looks.
    starts
        Looks since which a second fault may add enough, each at most ``SPACED`` times as long ago
        as the next but one.
    firsts
        The faults that were left when a single one last explained everything; empty: none has.
    suspected
        The first look after that.
    start
        Where the evidence of the pairs begins; None: with the episode.
    pairs
        Pairs that explain it.
    misfits
        What a single fault leaves of the last seconds.
    waits, searches
        Looks until the next search, and searches so far.
    """

    looks: deque[Look] = field(default_factory=lambda: deque(maxlen=RECENT_LOOKS))
    starts: list[Look] = field(default_factory=list)
    firsts: tuple[str, ...] = ()
    suspected: Look | None = None
    start: Look | None = None
    pairs: tuple[FaultPair, ...] = ()
    misfits: tuple[Misfit, ...] = ()
    waits: int = 0
    searches: int = 0

    def recent(self, sums: EvidenceSums) -> EvidenceSums | None:
        """What has come in the last seconds; None: the episode is no older."""
        whole = len(self.looks) == self.looks.maxlen
        return sums.since(self.looks[0].sums) if whole else None

    def keep(self, now: Look) -> None:
        """Keep what has been looked at, and forget what is near enough to another."""
        self.looks.append(now)
        self.starts.append(now)
        ago = [now.stamp_ns - look.stamp_ns for look in self.starts]
        for k in range(len(ago) - 2, 0, -1):
            if ago[k - 1] <= SPACED * ago[k + 1]:
                del self.starts[k], ago[k]

    def explain(self, names: Sequence[str]) -> None:
        """A single fault explains everything so far."""
        self.firsts = tuple(names)
        if self.suspected is not None:
            self.suspected = None
            self.waits = self.searches = 0

    def suspect(self, now: Look) -> None:
        """None does any more."""
        if self.suspected is None:
            self.suspected = now
            self.waits = self.searches = 0

    def resume(self, pairs: Sequence[record.TwoFaults]) -> None:
        """Go on from the pairs of the last verdict: their evidence is lost."""
        self.pairs = tuple(
            FaultPair(
                (pair.first, pair.second),
                (Fit(pair.first, 0.0, ()), Fit(pair.second, 0.0, ())),
                0.0,
                pair.probability,
            )
            for pair in pairs
        )

    def is_due(self) -> bool:
        """Whether to search now."""
        self.waits -= 1
        if self.waits > 0:
            return False
        self.waits = min(1 + self.searches // 2, MOST_WAITED)
        self.searches += 1
        return True

    def words(self, start_ns: int) -> str:
        """Which two faults there are, and since when the second, from the start of the stand."""
        said = "; ".join(" and ".join(pair.faults) for pair in self.pairs)
        which = "two faults: " if len(self.pairs) == 1 else "two faults, one of these pairs: "
        if self.start is None:
            return which + said
        since_s = (self.start.stamp_ns - start_ns) / 1e9
        return f"{which}{said}; the second seen from {since_s:.0f} s after the start"
