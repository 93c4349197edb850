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

"""Evidence of one stream: which unit it is of, when a fault is found, and what speaks for which."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.change_evidence import ChangeEvidence
from flea_diag.core.evidence.fault_evidence import FaultEvidence, OnsetWeighed, StreamHistory
from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS, HypothesisBank
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.stages.evidence.evidence_group import TOLD_WINDOWS, patience

Array = npt.NDArray[np.float64]

OTHER_ONSET_NATS, MOST_ONSETS = 10.0, 3
"""A fault that is not farther behind the best has its own onset weighed, too; so many onsets."""
APART_NATS = 3.5
"""What a fault must be ahead of another unit by, or another unit of any fault."""


class EvidenceLimits(NamedTuple):
    """Evidence over nothing from which on a fault, or another unit, is found, nats.

    ``before``: from the start of the stream.
    """

    onset: float
    before: float


class StreamChange(NamedTuple):
    """Something that began with a window, the limit that it exceeds, and what speaks for what."""

    onsets: tuple[int, ...]
    limit: float
    evidence: ChangeEvidence


class Found(NamedTuple):
    """A fault that is found: its model, its evidence in nats, and the change that it explains."""

    model: int
    nats: float
    change: StreamChange


class StreamEvidence:
    """See the module's first line.

    Parameters
    ----------
    hypotheses
        Of the unit of the calibration, and of another one.
    """

    def __init__(
        self, hypotheses: tuple[StreamHypotheses, StreamHypotheses], limits: EvidenceLimits,
        judged: npt.NDArray[np.bool_],
    ) -> None:  # fmt: skip
        self._own, self._another = hypotheses
        self._limits, self._judged = limits, judged
        self.history = StreamHistory()
        self._bank = HypothesisBank(self._own)
        self.begun = 0
        """Number of the first window that counts."""
        self._changed: StreamChange | None = None
        self.other_unit = -1
        """Window with which another unit took over; -1: none has."""
        self.may_be_unit = False
        """Whether another unit is beyond its limit, be something else likelier or not."""

    @property
    def hypotheses(self) -> StreamHypotheses:
        """Of the unit in use."""
        return self._own if self.other_unit < 0 else self._another

    @property
    def errors(self) -> Array:
        """Standardised errors of the last window under no fault, shape (relations,)."""
        return self._bank.errors

    @property
    def is_weighing(self) -> bool:
        """Whether a change has been seen of which it is not yet told what it is."""
        return self._changed is not None

    def rearm(self) -> None:
        """Nothing so far counts: what was found is over."""
        self.begun, self._changed = self.history.taken, None
        self._bank = HypothesisBank(self.hypotheses, self.begun)

    def take(self, window: LawWindow) -> None:
        """Take one window, of which nothing is asked."""
        self.history.add(window)
        self._bank.add(window)
        if self._changed is not None:
            self._changed.evidence.add(window)

    def add(self, window: LawWindow) -> Found | None:
        """Take one window; a fault, once one is found."""
        self.take(window)
        if self._changed is not None:
            return self.told(self._changed)
        if not self._bank.is_due or self._bank.windows <= ONSET_WINDOWS:
            return None
        self._changed = self._change()
        return None if self._changed is None else self.told(self._changed)

    def _change(self) -> StreamChange | None:
        """The onset of the most likely change, where one is beyond its limit."""
        faults, unit = self._bank.weighed(min(self._limits))
        faults = np.where(self._judged, faults, -np.inf)
        at_start = (self._bank.onsets == 0) & (self.begun == 0)
        limits = np.where(at_start, self._limits.before, self._limits.onset)
        beyond = faults - limits[:, None]
        if self.other_unit < 0:
            beyond = np.column_stack((beyond, unit - limits))
        at = int(beyond.max(axis=1).argmax())
        if beyond[at].max() <= 0.0:
            return None
        alike = np.where((at_start == at_start[at])[:, None], faults, -np.inf)
        places = [at, *_own_onsets(alike, float(faults[at].max()))]
        onsets = dict.fromkeys(self.begun + int(self._bank.onsets[place]) for place in places)
        return self.of_fault(tuple(onsets)[:MOST_ONSETS], float(limits[at]))

    def told(self, change: StreamChange) -> Found | None:
        """What a change was, once it is told: a fault, another unit, or nothing after all."""
        evidence = change.evidence
        if not evidence.windows:
            return None
        weighed = evidence.weighed()
        alone = np.where(self._judged, weighed.alone, -np.inf)
        with_unit = np.where(self._judged, weighed.with_unit - weighed.healthy_unit, -np.inf)
        unit = weighed.unit if self.other_unit < 0 else -np.inf
        over, more = alone - weighed.healthy, patience(evidence.windows)
        best, limit = int(over.argmax()), more * change.limit
        self.may_be_unit = unit > change.limit
        if over[best] > limit and alone.max() - unit > more * APART_NATS:
            return Found(best, float(over[best]), change)
        if unit > limit and with_unit.max() > limit:
            best = int(with_unit.argmax())
            return Found(best, float(with_unit[best]), change)
        if more > 1.0:
            return None
        if max(unit, over[best]) <= limit:
            self._changed = None
        elif unit - alone.max() > APART_NATS:
            self._changed = None
            self._go_over(change.onsets[0])
        return None

    def was_unit(self, change: StreamChange, weighed: OnsetWeighed) -> bool:
        """Whether all that has changed is the unit; if so, it is taken as another one."""
        if self.other_unit >= 0 or change.evidence.windows < TOLD_WINDOWS:
            return False
        alone = weighed.alone[self._judged].max()
        with_unit = (weighed.with_unit - weighed.healthy_unit)[self._judged].max()
        if weighed.unit - alone < APART_NATS or with_unit > change.limit:
            return False
        self._changed = None
        self._go_over(change.onsets[0])
        return True

    def is_no_unit(self, change: StreamChange, weighed: OnsetWeighed) -> bool:
        """Whether a fault is as far ahead of another unit as a fault must be of nothing.

        That another unit looks so has the probability of a false alarm: it is asked no more.
        """
        return change.evidence.windows >= TOLD_WINDOWS and self.leads(weighed) > change.limit

    def is_unit(self, change: StreamChange, weighed: OnsetWeighed) -> bool:
        """The same the other way round: another unit, be there a fault of it as well or not."""
        return change.evidence.windows >= TOLD_WINDOWS and -self.leads(weighed) > change.limit

    def leads(self, weighed: OnsetWeighed) -> float:
        """By how much a fault alone is ahead of another unit, nats."""
        return float(weighed.alone[self._judged].max()) - weighed.unit

    def _go_over(self, onset: int) -> None:
        """Another unit is in use from a window on: nothing before it counts."""
        self.other_unit = onset
        self.begun = onset + ONSET_WINDOWS * (onset > 0)
        self._bank = HypothesisBank(self._another, self.begun)
        for window in self.history.since(self.begun):
            self._bank.add(window)

    def of_fault(self, onsets: tuple[int, ...], limit: float) -> StreamChange:
        """A fault with one of these onsets, from the history."""
        evidence = of_change(self.history, self.hypotheses, self.begun, onsets)
        return StreamChange(onsets, limit, evidence)


def of_change(
    history: StreamHistory, hypotheses: StreamHypotheses, begun: int, onsets: Sequence[int]
) -> ChangeEvidence:
    """Evidence on what began with one of these windows; ``begun``: the first that counts."""
    first = max(begun, history.taken - len(history.windows))
    windows, places = history.since(first), [max(onset - first, 0) for onset in onsets]
    return ChangeEvidence([FaultEvidence(hypotheses, p, windows, first, places) for p in places])


def _own_onsets(faults: Array, best: float) -> Array:
    """Places of the onsets by which faults fit best that are not far behind; (onsets, models)."""
    near = faults.max(axis=0) > best - OTHER_ONSET_NATS
    return np.asarray(faults[:, near].argmax(axis=0))


def limits_of(models: int, rate_per_hour: float, onsets_per_hour: float) -> EvidenceLimits:
    """Lower bounds: under no fault a ratio exceeds exp(x) with a probability of at most exp(-x)."""
    return EvidenceLimits(
        math.log(models * onsets_per_hour / rate_per_hour),
        math.log(models / (rate_per_hour * START_HOURS)),
    )


START_HOURS = 30.0 / 3600.0
"""Time for which the start of a stream stands, of those that are judged a rate in an hour."""
