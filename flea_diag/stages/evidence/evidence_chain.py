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

"""The observer's chain where the evidence detects: residuals without a test of the relations.

Nothing is learned of the unit, and predicted temperatures are never corrected: the law was learned
from such residuals.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.stages.evidence.evidence_detection import EvidenceDetection, EvidenceKnowledge
from flea_diag.stages.observer.channels import ChannelReadings
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.regressor_table import answers_of
from flea_diag.stages.observer.residual_records import ResidualRecords
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.stages.observer.residual_tests import SensorTestsAlone
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import NEVER_NS, OTHER_UNIT, ChannelQuality, Quality, Record

OTHER = "another unit than the calibrated one, as healthy units differ"


class EvidenceChain(ObserverChain):
    """See the module's first line; the episode is that of an ``EvidenceDetection``."""

    episode: EvidenceDetection

    def __init__(
        self, knowledge: EvidenceKnowledge, calibration: Calibration, effects: EffectSet,
        parameters: ObserverParameters,
    ) -> None:  # fmt: skip
        self._k = knowledge
        answers = answers_of(effects, calibration.parameters, knowledge.relations)
        super().__init__(calibration, effects, replace(parameters, warm_up_s=0.0), answers)
        rows = effects.residuals
        self._records = ResidualRecords(rows, calibration, self.stream.regressor_names)
        self._judged = np.array([rows.place[name] for name in knowledge.relations], dtype=int)
        self._limit = math.sqrt(2.0 * knowledge.limits.onset)

    def _detection(self) -> EvidenceDetection:
        return EvidenceDetection(self._k, self._parameters.rearm_after_s)

    def _tests(self, estimates: bool) -> SensorTestsAlone:
        return SensorTestsAlone(self._effects.relations)

    @property
    def freezes(self) -> bool:
        """Always: see the module's first lines."""
        return True

    def happens(self, block: ScanBlock, output: StreamOutput) -> int:
        """The first scan with which the evidence causes a record, or n."""
        return self._take(block, output)[0]

    def detect(self, block: ScanBlock, output: StreamOutput) -> tuple[Record, ...]:
        """Records that one scan causes."""
        return self._take(block, output)[1]

    def _take(self, block: ScanBlock, output: StreamOutput) -> tuple[int, tuple[Record, ...]]:
        """Hand residuals on, and take back how the law judges their windows."""
        if self.order.rate.off_hz:
            return len(block), ()
        taken = self.episode.take(self._records.block(block, output))
        results = output.results
        results.z = results.z.copy()  # what the ledger of judgement goes on counting stays
        results.z[:, self._judged] += self.episode.z(len(block))
        results.k[:, self._judged] = self._limit
        output.records = None  # those of the observer have these values
        return taken

    def other_unit(self, reading: ChannelReadings) -> int:
        """None that the evidence does not find."""
        return len(reading.usable)

    @property
    def told(self) -> bool:
        """Whether the last scan has changed what is reported beside channels."""
        return super().told or self.episode.unit_turned

    def states(self) -> tuple[ChannelQuality, ...]:
        """Rows of DataQuality beside those of channels."""
        since_ns = self.episode.unit_ns
        if since_ns == NEVER_NS:
            return super().states()
        return (*super().states(), ChannelQuality(OTHER_UNIT, Quality.GOOD, since_ns, OTHER))
