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

"""What had next to nothing to judge, in words, and the faults that therefore were not looked for.

The words name only what the readings are to blame for: that a stop voids a relation, or that the
motion is outside the calibration, is said by their own rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.wire.records import Cause, DataQuality

OF_THE_PLACE = (Cause.VOID, Cause.OUTSIDE)
MOST_GROUPS = 3
"""Most causes that the words of a verdict name."""


@dataclass(frozen=True)
class Unjudged:
    """Relation or test of a sensor -> why it was not judged in the last 10 s."""

    why: Mapping[str, str] = field(default_factory=dict)
    judged: frozenset[str] = frozenset()
    """Those that were."""
    void: Mapping[str, str] = field(default_factory=dict)
    """Why those were not that the place or the motion of the machine keeps from it."""

    @classmethod
    def of(cls, quality: DataQuality, known: ResidualSet) -> Unjudged:
        """From the ledger of the observer; a relation is judged where any form of it is."""
        judged = frozenset(known.relation(row.residual) for row in quality.judged if row.judged)
        low = [row for row in quality.judged if known.relation(row.residual) not in judged]
        why = {known.relation(r.residual): r.why for r in low if r.cause.is_of_the_data}
        void = {known.relation(r.residual): r.why for r in low if r.cause in OF_THE_PLACE}
        return cls(why, judged, {name: words for name, words in void.items() if name not in why})

    @property
    def names(self) -> tuple[str, ...]:
        """What was not judged."""
        return (*self.why, *self.void)

    def nothing_left(self, relations: tuple[str, ...], friction: str) -> str:
        """Why neither motor nor screw are judged; empty: they are.

        ``relations`` are those of the stand, ``friction`` the one that they show in.
        """
        lost = [name for name in (friction,) if name in self.why]
        if not lost and relations and all(name in self.why for name in relations):
            lost = list(relations)
        return self._grouped(lost)

    def words(self) -> str:
        """All of it, by cause; empty: everything was judged."""
        return self._grouped(list(self.why))

    def _grouped(self, names: list[str]) -> str:
        groups: dict[str, list[str]] = {}
        reasons = {**self.why, **self.void}
        for name in names:
            groups.setdefault(reasons[name], []).append(name)
        said = [f"{', '.join(group)} ({why})" for why, group in groups.items()]
        rest = len(said) - MOST_GROUPS
        more = [f"{rest} more"] if rest > 0 else []
        return ", ".join((*said[:MOST_GROUPS], *more))

    def faults(self, tests: Mapping[str, frozenset[str]]) -> tuple[tuple[str, str], ...]:
        """Faults of which no test was judged, each with the first reason; ``tests`` of each."""
        return tuple(
            (fault, f"not looked for in the last 10 s: {self._grouped(sorted(of_it))}")
            for fault, of_it in tests.items()
            if of_it <= self.why.keys() | self.void.keys()
        )
