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

"""What a stand knows of faults that come and go."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawScans, LawWindowMeans
from flea_diag.core.frozen import Frozen
from flea_diag.core.recurrence.presence import MOMENTS
from flea_diag.wire.blocks import ResidualBlock


class WindowSource(Protocol):
    """Makes windows of the law out of residuals; see ``StreamColumns``."""

    def scans(self, block: ResidualBlock) -> LawScans:
        """What windows are made of."""

    def means(self, names: tuple[str, ...], scans: int = 0) -> LawWindowMeans:
        """What makes windows of so many scans, 0: those of the law."""


@dataclass(frozen=True, eq=False)
class RecurrenceKnowledge(Frozen):
    """What a stand knows of faults that come and go.

    Attributes
    ----------
    hypotheses
        Of its law.
    columns
        Makes what makes the windows of one stream.
    faults
        Of every model the fault, and the number of the reading that it is an error of; -1: of none.
    usable
        Of every model whether its fault can come and go.
    fast
        Of every relation whether it is looked at.
    position
        Signal that tells the place along the stroke; empty: none does. ``place_unit`` is its unit.
    load
        Place of the load among the signals.
    delay_s, scans
        Of smoothing, and of one window.
    """

    hypotheses: StreamHypotheses
    columns: Callable[[], WindowSource]
    faults: tuple[tuple[str, int], ...]
    usable: tuple[bool, ...]
    fast: tuple[bool, ...]
    position: str
    place_unit: str
    load: int
    delay_s: float
    scans: int

    @property
    def moments(self) -> int:
        """Into which a window is parted, each of whole scans."""
        return math.gcd(MOMENTS, self.scans)
