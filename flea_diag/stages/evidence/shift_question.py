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

"""What a shift is, by the law: a fault, or another unit.

The windows of the law before and since are weighed together. Where another unit is not beyond its
limit, a shift is a fault at once. That it is one holds until later windows tell another unit.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum, auto

from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.stages.evidence.evidence_group import TOLD_WINDOWS
from flea_diag.stages.evidence.stream_evidence import Found, StreamEvidence

LOOKS = 5
"""Windows from look to look at whether an open episode is over, or was another unit: 1 s."""
SUDDEN_WINDOWS = 1 + 2 * ONSET_WINDOWS
"""Windows until one counts of what begins with the present one: an onset begins every
``ONSET_WINDOWS``, and as many after it and one before it hold a part of what has begun."""


class ShiftAnswer(Enum):
    """What a shift is; ``FAULT`` also where the law has seen enough of it and cannot tell."""

    UNTOLD = auto()
    FAULT = auto()
    OTHER_UNIT = auto()


class ShiftQuestion:
    """Asked with the windows up to a shift.

    Parameters
    ----------
    sudden
        Whether it is seen before any window that counts holds it: that the law finds nothing yet
        tells nothing.

    Attributes
    ----------
    answer
        As far as is known. A fault that came with another unit is a fault.
    """

    def __init__(
        self, stream: StreamEvidence, windows: Iterable[LawWindow], sudden: bool = False
    ) -> None:
        self._stream, self.sudden = stream, sudden
        self._patience = TOLD_WINDOWS + SUDDEN_WINDOWS * sudden
        self._found: Found | None = None
        self._asked = 0
        self._settled = False
        """Whether the answer is final."""
        self.answer = ShiftAnswer.UNTOLD
        self.answer = self._told(windows)

    @property
    def is_asked(self) -> bool:
        """Whether windows to come may change the answer."""
        return not self._settled and self.answer is not ShiftAnswer.OTHER_UNIT

    def end(self) -> None:
        """It is a fault, until windows to come tell another unit."""
        self.answer = ShiftAnswer.FAULT

    def add(self, window: LawWindow) -> bool:
        """Take one more window; whether the answer is another one now."""
        before = self.answer
        if not self.is_asked:
            return False
        self._asked += 1
        answer = self._told((window,)) if self._found is None else self._kept(self._found, window)
        if answer is not ShiftAnswer.UNTOLD:
            self.answer = answer
        return self.answer is not before

    def _kept(self, found: Found, window: LawWindow) -> ShiftAnswer:
        """Whether a fault still is one; looked at now and then, until another unit cannot be."""
        self._take(found, window)
        if self._asked % LOOKS == 0:
            weighed = found.change.evidence.weighed()
            if self._stream.was_unit(found.change, weighed):
                return ShiftAnswer.OTHER_UNIT
            self._settled = self._is_told(found) or self._stream.is_no_unit(found.change, weighed)
        return ShiftAnswer.FAULT

    def _is_told(self, found: Found) -> bool:
        """Whether another unit would have shown since a thermocouple has stepped.

        It shows with the first motion forth and back; what comes later may be of the run.
        """
        evidence = found.change.evidence
        both_ways = evidence.first.goes_both_ways
        return self.sudden and both_ways and evidence.windows >= TOLD_WINDOWS

    def _take(self, found: Found, window: LawWindow) -> None:
        self._stream.history.add(window)
        found.change.evidence.add(window)

    def _told(self, windows: Iterable[LawWindow]) -> ShiftAnswer:
        """By all of these windows: what the first ones tell, the others may tell better."""
        stream, rest = self._stream, iter(windows)
        found = next(filter(None, map(stream.add, rest)), None)
        later = list(rest)
        if found is not None and later:
            for window in later:
                stream.take(window)
            found = stream.told(found.change)
        # What began before the shift may look like another unit, too: it is no answer to this.
        if found is None and stream.other_unit > 0 and not stream.is_weighing:
            return ShiftAnswer.OTHER_UNIT
        if self.sudden and self.answer is ShiftAnswer.UNTOLD and found is not None:
            weighed = found.change.evidence.weighed()
            if stream.is_unit(found.change, weighed):
                return ShiftAnswer.OTHER_UNIT
            both_ways = found.change.evidence.first.goes_both_ways
            is_alone = both_ways and stream.leads(weighed) > 0.0
            found = found if is_alone or self._asked >= self._patience else None
        self._found = found
        may_be = self.sudden or stream.may_be_unit
        waits = found is None and may_be and self._asked < self._patience
        return ShiftAnswer.UNTOLD if waits else ShiftAnswer.FAULT
