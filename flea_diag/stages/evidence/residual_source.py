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

"""Residuals of a stream of scans without a test: what a baseline of its own detection starts from.

The relations, their void conditions and the cross-check of the voltage are those of the diagnosis.
Nothing is learned of the unit, and predicted temperatures are never corrected.
"""

from __future__ import annotations

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.stages.observer.block_replay import BlockReplay
from flea_diag.stages.observer.channels import ChannelReadings
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.residual_records import ResidualRecords
from flea_diag.stages.observer.residual_stream import StreamOutput
from flea_diag.stages.observer.state_estimate import NONE
from flea_diag.stages.stream.stream_order import Place
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import ChannelTable, Record, Scan


class UntestedChain(ObserverChain):
    """The chain of the observer with corrections off, whatever its tests say."""

    def follow(self, block: ScanBlock) -> tuple[int, StreamOutput]:
        """Take scans in order: the first with which a condition turns (or n), and the output."""
        self.order.follow(block.stamps_ns)
        _, output = self.examine(block, self.channels.read(block))
        return output.turn, output

    def examine(self, block: ScanBlock, reading: ChannelReadings) -> tuple[int, StreamOutput]:
        """As the observer, with every correction frozen."""
        output = self.stream.step(block.stamps_ns, reading.usable, frozen=True)
        return self.channels.judge(block.stamps_ns, reading, output.voltage.trusted), output


class ResidualSource:
    """Scans in, residuals out."""

    consumes: tuple[type, ...] = (ChannelTable, Scan)
    takes_blocks = True

    def __init__(self, calibration: Calibration, effects: EffectSet) -> None:
        parameters = ObserverParameters(warm_up_s=0.0, state_observer=NONE)
        self._chain: ObserverChain = UntestedChain(calibration, effects, parameters, ())
        self._replay = BlockReplay()
        names = self._chain.stream.regressor_names
        self._records = ResidualRecords(effects.residuals, calibration, names)
        self._table: ChannelTable | None = None

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Residuals of a scan."""
        self._replay.forget()
        if isinstance(record, ChannelTable):
            self._table = record
            self._chain.take_ranges(record)
        if not isinstance(record, Scan):
            return ()
        place = self._chain.order.step(record.stamp_ns)
        if place is Place.PASSED_OVER:
            return ()
        if place is Place.RESTART:
            self._chain.begin(record.stamp_ns, self._table)
        elif place is Place.AFTER_GAP:
            self._chain.stream.interrupt()
        block = ScanBlock(np.array([record.stamp_ns]), record.channels, np.array([record.values]))
        _, output = self._chain.examine(block, self._chain.channels.read(block))
        return tuple(self._records.block(block, output).records())

    def handle_block(self, block: ScanBlock) -> tuple[int, tuple[ResidualBlock, ...]]:
        """Residuals of the leading scans; see ``ObserverStage.handle_block``."""
        self._chain, quiet, output = self._replay.take(self._chain, block)
        if output is None:
            return 0, ()
        return quiet, (self._records.block(block.part(slice(quiet)), output),)
