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

"""The observer's chain, which asks the law whether a shift is a fault or another unit.

A shift test holds a run against its own earlier level, which is that of one unit. Where units are
equally warm, no thermocouple tells that control went over to another one, whose level is another.
So before a shift opens an episode the windows of the law are weighed (``StreamEvidence``): nothing,
another unit, or a fault. Another unit begins a new stream, as one that thermocouples tell does;
anything else opens the episode, at the latest when the law has seen as much as it takes to tell.

A unit with one thermocouple has none that would step with it: that it alone has stepped tells an
error of it where there are others, and here nothing. So the law is asked of it, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.evidence.kept_scans import KeptScans
from flea_diag.core.evidence.stream_windows import LawWindow, LawWindowMeans
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.stages.evidence.evidence_detection import EvidenceKnowledge
from flea_diag.stages.evidence.shift_question import ShiftAnswer, ShiftQuestion
from flea_diag.stages.observer.channels import ChannelReadings
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.residual_records import ResidualRecords
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.stages.recurrence.waiting_scans import WaitingScans
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Record

Flags = npt.NDArray[np.bool_]

KEPT_S = 20.0
"""History that is weighed: as long as the earlier level of a shift."""
TOGETHER = 5
"""Windows whose scans are kept together while nothing is asked."""


class UnitChain(ObserverChain):
    """See the module's first lines."""

    def __init__(
        self, knowledge: EvidenceKnowledge, calibration: Calibration, effects: EffectSet,
        parameters: ObserverParameters,
    ) -> None:  # fmt: skip
        self._k = knowledge.of_any_unit
        rows = effects.residuals
        # A predicted temperature follows its sensor while nothing deviates: it keeps no change,
        # but that of which the law is asked.
        alone = rows.lone_temperature
        self._alone = np.array([row.name in alone for row in rows.rows])
        """The one thermocouple of the unit, by residual; none where there are more."""
        slow = set(rows.predictions).difference(alone)
        self._slow = np.array([name in slow for name in knowledge.relations])
        self._position = rows.position if rows.position in effects.names else ""
        super().__init__(calibration, effects, parameters)
        self._records = ResidualRecords(rows, calibration, self.stream.regressor_names)

    def _renew(self) -> None:
        super()._renew()
        self._forget()

    def _forget(self) -> None:
        """Nothing so far counts."""
        self._columns = self._k.columns()
        self._waiting = WaitingScans(self._k.scans, self._position)
        self._kept: KeptScans | None = None
        self._means: LawWindowMeans | None = None
        """Makes windows while the question is asked."""
        self._question: ShiftQuestion | None = None
        """Of a shift that has not opened an episode yet, or of the one that opened it."""

    def happens(self, block: ScanBlock, output: StreamOutput) -> int:
        """The first scan with which the detection causes a record, or the law has its answer."""
        waits, first = self._is(ShiftAnswer.UNTOLD), super().happens(block, output)
        answered = self._add(block, output)
        return min(self._beside(output) if waits else first, answered)

    def detect(self, block: ScanBlock, output: StreamOutput) -> tuple[Record, ...]:
        """Records of the detection that one scan causes."""
        self._add(block, output)
        if self._question is None and not self.episode.is_open:
            if output.results.quiet and self.stream.conditions.begins is None:
                return ()
            if self._shifts(output):
                sudden = bool(output.results.deviating()[0, self._alone].any())
                self._question = self._asked(sudden)
                if sudden:  # levels before it may be those of another unit
                    self.stream.turn(opened=True, by=output.results)
        elif self._question is not None and self._beside(output) == 0:
            self._question.end()
        if self._is(ShiftAnswer.UNTOLD) or self._is(ShiftAnswer.OTHER_UNIT):
            return ()
        caused = super().detect(block, output)
        if not self.episode.is_open:
            self._forget_question()
        return caused

    def _forget_question(self) -> None:
        """What was asked of has opened nothing, or is over."""
        if self._question is not None and self._question.sudden:
            self.stream.turn(opened=False)
        self._question = None

    def _is(self, answer: ShiftAnswer) -> bool:
        return self._question is not None and self._question.answer is answer

    def _add(self, block: ScanBlock, output: StreamOutput) -> int:
        """Take the windows that these scans complete; the first scan that answers, or n."""
        answered = len(block)
        if self.stream.learns:  # until its zeros are known, a residual is another quantity
            return answered
        before = len(self._waiting)
        self._waiting.extend(self._records.block(block, output))
        if not self._waiting.complete(TOGETHER if self._question is None else 1):
            return answered
        question = self._question
        for number, window in self._keep():
            if question is not None and question.add(self._changing(window)):
                answered = min(answered, number - before)
        return answered

    def _keep(self) -> Iterator[tuple[int, LawWindow]]:
        """Keep the scans that wait; windows of them, each with its last scan, while it is asked."""
        placed = self._waiting.taken()
        if self._kept is None:
            means = self._columns.means(placed.regressor_names)
            self._kept = KeptScans(means, self._k.scans, round(KEPT_S / WINDOW_S))
        scans = self._columns.scans(placed)
        self._kept.add(scans)
        if self._question is None or not self._question.is_asked:
            self._means = None
        return iter(()) if self._means is None else self._means.add(scans)

    def _asked(self, sudden: bool) -> ShiftQuestion:
        """Of the windows up to now."""
        if self._waiting.complete():
            self._keep()
        if self._kept is None:
            return ShiftQuestion(self._k.stream(), ())
        self._means, windows = self._kept.windows()
        count = len(windows.values)
        every = (self._changing(windows.part(k)) for k in range(count))
        return ShiftQuestion(self._k.stream(), every, sudden)

    def _changing(self, window: LawWindow) -> LawWindow:
        """A window without what keeps no change."""
        return replace(window, values=np.where(self._slow, np.nan, window.values))

    def _shifts(self, output: StreamOutput) -> bool:
        """Whether something deviates, and all that does has left its own earlier level."""
        return bool(output.results.deviating()[0].any()) and not self._beyond(output)[0].any()

    def _beyond(self, output: StreamOutput) -> Flags:
        """What deviates from all healthy units, (scans, residuals): no level of its own is left."""
        results = output.results
        return np.asarray(results.deviating() & np.isnan(results.shift) & ~self._alone)

    def _beside(self, output: StreamOutput) -> int:
        """The first scan at which more deviates than the thermocouple that is asked about, or n."""
        count = len(output.results.z)
        question = self._question
        if question is None or not question.sudden or question.answer is not ShiftAnswer.UNTOLD:
            return count
        scans = np.flatnonzero(self._beyond(output).any(axis=1))
        return int(scans[0]) if len(scans) else count

    @property
    def freezes(self) -> bool:
        """Also while it is asked whether what deviates is another unit."""
        return super().freezes or self._is(ShiftAnswer.UNTOLD)

    def other_unit(self, reading: ChannelReadings) -> int:
        """The first scan at which another unit is in use, or n."""
        return 0 if self._is(ShiftAnswer.OTHER_UNIT) else super().other_unit(reading)
