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

"""Rate of a stream of scans by its stamps, held against the rate of the calibration.

Smoothing, derivatives and windows are counted in scans: at another rate every speed is wrong by the
ratio, which reads as a fault of a sensor. A deviation counts beyond ``LEAST`` and five standard
errors by the jitter of the stamps themselves, over half a second to five at 100 Hz. A source that
sends every second or third scan, always, is one of a lower rate.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Stamps = npt.NDArray[np.int64]

EVERY = 50
"""Scans from one look at the rate to the next."""
LOOKS = (1, 2, 10)
"""Numbers of such stretches that are looked at."""
LEAST, SIGMAS = 0.004, 5.0
"""Relative deviation that counts where stamps do not jitter, and standard errors where they do."""
ALWAYS = 0.95
"""Share of the scans after which the same number is missing: the rate is lower, nothing is lost."""
MOST_MISSING = 9
"""Most missing scans that are told apart: a stream is not interrupted by fewer."""
UNSURE, SCATTERED = 0.35, 0.1
"""Parts of a period: beside the grid by more, a scan counts as unsure where stamps scatter so."""


class _Mark(NamedTuple):
    """So far: scans by the number missing before them, and what stamps are beside their grid.

    ``beside_ns``: sum over the scans, ``squares``: sum of the squares; exact whole numbers.
    ``unsure``: scans so far beside it that a period too many or too few may have been counted.
    """

    missing: tuple[int, ...]
    beside_ns: int
    squares: int
    unsure: int


class ScanRate:
    """Rate of one stream.

    Parameters
    ----------
    period_ns : time between two scans of the calibration
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self.off_hz = 0.0
        """Rate of the scans while it is another than that of the calibration, else 0."""
        self.forget()

    def forget(self) -> None:
        """Nothing spans the next scan: a gap, or a clock that was set."""
        self._scans = self._beside_ns = self._squares = self._unsure = 0
        self._missing = [0] * (MOST_MISSING + 1)
        self._marks: deque[_Mark] = deque([self._mark()], maxlen=1 + LOOKS[-1])

    def _mark(self) -> _Mark:
        return _Mark(tuple(self._missing), self._beside_ns, self._squares, self._unsure)

    def step(self, ahead_ns: int, missing: int) -> bool:
        """Take a scan so long after the one before; whether what is said has changed."""
        beside_ns = ahead_ns - (missing + 1) * self._period_ns
        self._beside_ns += beside_ns
        self._squares += beside_ns * beside_ns
        self._unsure += abs(beside_ns) > UNSURE * self._period_ns
        self._missing[min(missing, MOST_MISSING)] += 1
        self._scans += 1
        return self._scans % EVERY == 0 and self._look()

    def _look(self) -> bool:
        self._marks.append(self._mark())
        before, self.off_hz = self.off_hz, self._judged(self._marks)
        return bool(before) != bool(self.off_hz)

    def _judged(self, marks: deque[_Mark]) -> float:
        """Rate by these marks where it is another than that of the calibration, else 0."""
        for stretches in LOOKS:
            if len(marks) <= stretches:
                break
            first, last = marks[-1 - stretches], marks[-1]
            scans, periods, most = _counted(first, last)
            regular = most > 0
            beside_ns = last.beside_ns - first.beside_ns
            scatter = (last.squares - first.squares) / scans - (beside_ns / scans) ** 2
            deviation = math.sqrt(max(scatter, 0.0)) / self._period_ns
            error = SIGMAS * deviation / periods
            if deviation > SCATTERED:
                error += (last.unsure - first.unsure) / periods
            longer = beside_ns / (periods * self._period_ns)
            if regular or abs(longer) > LEAST + error:
                times = (most + 1 if regular else 1) * (1.0 + longer)
                return 1e9 / (times * self._period_ns)
        return 0.0

    def leading(self, before_ns: int, stamps_ns: Stamps) -> int:
        """How many scans, none of them lost, come before one that changes what is said.

        ``before_ns`` is the stamp of the scan before them.
        """
        count = len(stamps_ns)
        ends = self._ends(count)
        if not ends:
            return count
        marks = self._marks.copy()
        beside_ns, squares, unsure = self._sums(before_ns, stamps_ns)
        for at in ends:
            missing = (self._missing[0] + at, *self._missing[1:])
            sums = self._beside_ns + int(beside_ns[at - 1]), self._squares + int(squares[at - 1])
            marks.append(_Mark(missing, *sums, self._unsure + int(unsure[at - 1])))
            if bool(self._judged(marks)) != bool(self.off_hz):
                return at - 1
        return count

    def follow(self, before_ns: int, stamps_ns: Stamps) -> None:
        """Take scans of which none is lost and none changes what is said."""
        count, missing = len(stamps_ns), self._missing[0]
        ends = self._ends(count)
        if not ends:
            for before, stamp in pairwise((before_ns, *stamps_ns.tolist())):
                self.step(stamp - before, 0)
            return
        sums = self._beside_ns, self._squares, self._unsure
        beside_ns, squares, unsure = self._sums(before_ns, stamps_ns)
        for at in dict.fromkeys((*ends, count)):
            self._missing[0] = missing + at
            self._beside_ns = sums[0] + int(beside_ns[at - 1])
            self._squares = sums[1] + int(squares[at - 1])
            self._unsure = sums[2] + int(unsure[at - 1])
            if at in ends:
                self._marks.append(self._mark())
        self.off_hz = self._judged(self._marks)
        self._scans += count

    def _ends(self, count: int) -> range:
        """After how many of so many scans the rate is looked at."""
        return range(-self._scans % EVERY or EVERY, count + 1, EVERY)

    def _sums(self, before_ns: int, stamps_ns: Stamps) -> tuple[Stamps, Stamps, Stamps]:
        """Sums up to each scan: what it is beside the grid, the squares, and scans far beside."""
        beside_ns = np.diff(stamps_ns, prepend=before_ns) - self._period_ns
        far = np.abs(beside_ns) > UNSURE * self._period_ns
        return np.cumsum(beside_ns), np.cumsum(beside_ns * beside_ns), np.cumsum(far)


def _counted(first: _Mark, last: _Mark) -> tuple[int, int, int]:
    """Scans and periods between two marks, and how many are missing before each; 0: not as many."""
    if first.missing[1:] == last.missing[1:]:  # mostly none is
        scans = last.missing[0] - first.missing[0]
        return scans, scans, 0
    counts = [b - a for a, b in zip(first.missing, last.missing, strict=True)]
    scans = sum(counts)
    most = max(range(len(counts)), key=counts.__getitem__)
    if 0 < most < MOST_MISSING and counts[most] >= ALWAYS * scans:
        return scans, scans * (most + 1), most
    return scans, sum(count * (missing + 1) for missing, count in enumerate(counts)), 0
