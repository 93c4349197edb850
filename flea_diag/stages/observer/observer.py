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

"""Observer stage: scans in; Residual, DataQuality, Detection and Symbols out.

``observer_chain`` does the work on a scan; ``block_replay`` takes quiet scans in blocks; after a
restart the last verdict supplies the state of the run (``takeover``).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.core.vibration.unjudged import said, unjudged
from flea_diag.stages.observer.block_replay import BlockReplay
from flea_diag.stages.observer.observer_chain import ObserverChain
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.residual_records import ResidualRecords
from flea_diag.stages.observer.takeover import takeover
from flea_diag.stages.stream.stream_order import Place
from flea_diag.wire.blocks import ResidualBlock, ScanBlock
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    DRIVER_DEAD,
    VIBRATION,
    AmbiguityGroup,
    ChannelQuality,
    ChannelTable,
    DataQuality,
    Quality,
    Record,
    Scan,
)


class ObserverStage:
    """Detection of the diagnosis; records in, records out."""

    consumes: tuple[type, ...] = (ChannelTable, Scan, AmbiguityGroup)
    takes_blocks = True

    def __init__(
        self,
        calibration: Calibration,
        effects: EffectSet,
        parameters: ObserverParameters,
        nominal: NominalRanges | None = None,
        chain: ObserverChain | None = None,
    ) -> None:
        self._nominal = nominal
        self._deaf: tuple[ChannelQuality, ...] = ()
        self._chain = chain or ObserverChain(calibration, effects, parameters)
        self._replay = BlockReplay()
        self._records = ResidualRecords(
            effects.residuals, calibration, self._chain.stream.regressor_names
        )
        names = zip(UNIT_PARAMETERS, calibration.tolerances(), strict=False)
        self._tolerances = {
            name: tolerance + abs(getattr(calibration.parameters, name))
            for name, tolerance in names
        }
        self._table: ChannelTable | None = None
        self._swapped = False
        """Whether the channel table has named another unit since the stream began."""
        self._verdict: AmbiguityGroup | None = None

    def handle(self, record: Record) -> tuple[Record, ...]:
        """Records caused by a ChannelTable, a Scan or a verdict."""
        self._replay.forget()
        if isinstance(record, Scan):
            return self._scan(record)
        if isinstance(record, ChannelTable):
            self._swapped |= _are_others(self._table, record)
            self._table = record
            self._chain.take_ranges(record)
            self._deaf = self._unheard(record)
        elif isinstance(record, AmbiguityGroup) and self._holds_more(record):
            self._verdict = record
        stamp_ns = self._chain.order.last_ns
        learned, opened = self._take_over()
        quality = (self._quality(stamp_ns),) if learned and stamp_ns is not None else ()
        return (*quality, *opened)

    def _holds_more(self, verdict: AmbiguityGroup) -> bool:
        """Whether a verdict is to be asked in place of the one before.

        Until the table is known nothing is taken over, and the first verdict since a restart says
        nothing yet: it does not replace what the one before it holds.
        """
        says_something = bool(verdict.offsets) or verdict.episode > 0
        return self._table is not None or says_something or self._verdict is None

    def _take_over(self) -> tuple[bool, tuple[Record, ...]]:
        """Whether the verdict ends the warm-up, and the Detection of an episode that is open."""
        chain = self._chain
        past = takeover(self._verdict, self._table, chain.order.first_ns, self._tolerances)
        if past is None or not chain.stream.learns:
            return False, ()
        chain.stream.recall(past.offsets, within=past.episode > 0)
        if not past.episode:
            return True, ()
        chain.stream.turn(opened=True)
        chain.wiring.close()
        return True, (chain.episode.take_over(past.opened_ns, past.episode),)

    def handle_block(self, block: ScanBlock) -> tuple[int, tuple[ResidualBlock, ...]]:
        """Take the leading scans that cause residuals and nothing else.

        Returns
        -------
        How many they are, and their residuals. All others are left to ``handle``.
        """
        self._chain, quiet, output = self._replay.take(self._chain, block)
        if output is None:
            return 0, ()
        return quiet, (self._records.block(block.part(slice(quiet)), output),)

    def _scan(self, scan: Scan) -> tuple[Record, ...]:
        chain = self._chain
        place = chain.order.step(scan.stamp_ns)
        if place is Place.PASSED_OVER:
            return ()
        taken_over: tuple[Record, ...] = ()
        if place is Place.RESTART:
            self._swapped = False
            chain.begin(scan.stamp_ns, self._table)
            _, taken_over = self._take_over()
        block = ScanBlock(np.array([scan.stamp_ns]), scan.channels, np.array([scan.values]))
        if place is Place.AFTER_GAP:
            if self._swapped:
                return self._go_over(block, scan.stamp_ns)
            chain.stream.interrupt()
            chain.wiring.again(scan.stamp_ns, chain.episode.is_open)
        reading = chain.channels.read(block)
        if chain.other_unit(reading) == 0:
            return self._go_over(block, scan.stamp_ns)
        learns, was_open = chain.stream.learns, chain.episode.is_open
        changed, output = chain.examine(block, reading)
        found = chain.detect(block, output)
        if chain.episode.is_open != was_open:
            chain.stream.turn(opened=not was_open, by=output.results)
        learned = learns and not chain.stream.learns
        chain.watch_wiring(block, reading, output)
        wired = chain.wiring.step(scan.stamp_ns, opens=chain.episode.is_open and not was_open)
        told = learned or wired or chain.told
        is_due = changed == 0 or told or chain.order.is_due(scan.stamp_ns)
        quality = (self._quality(scan.stamp_ns),) if is_due else ()
        return (*taken_over, *quality, *self._records.block(block, output).records(), *found)

    def _go_over(self, block: ScanBlock, stamp_ns: int) -> tuple[Record, ...]:
        """Another unit is in use: close the episode of the last one and start a new stream."""
        chain = self._chain
        self._swapped = False
        closed = chain.episode.close(stamp_ns, ANOTHER_UNIT)
        chain.begin(stamp_ns, self._table)
        chain.wiring.close()
        _, output = chain.examine(block, chain.channels.read(block))
        residuals = self._records.block(block, output).records()
        return (self._quality(stamp_ns), *residuals, closed)

    def report(self) -> DataQuality | None:
        """How readings and judgement stand after the last scan; None before the first."""
        order = self._chain.order
        return None if order.last_ns is None else self._state(order.last_ns, order.state())

    def _quality(self, stamp_ns: int) -> DataQuality:
        """Say state and counters of the stream and of every channel."""
        self._chain.stream.ledger.unsaid = False
        return self._state(stamp_ns, self._chain.order.say(stamp_ns))

    def _state(self, stamp_ns: int, stream: ChannelQuality) -> DataQuality:
        chain = self._chain
        if chain.channels.driver_dead:
            stream = replace(stream, quality=Quality.BAD, reason=DRIVER_DEAD)
        channels = chain.wiring.marked(chain.channels.states(chain.stream.stuck))
        rows = (stream, *channels, *self._deaf, *chain.states())
        return DataQuality(stamp_ns, rows, chain.stream.offsets, chain.stream.ledger.report())

    def _unheard(self, table: ChannelTable) -> tuple[ChannelQuality, ...]:
        """The row of accelerometers that no nominal range can judge."""
        if self._nominal is None:
            return ()
        axes = {r.name: r.rate_hz for r in table.channels if r.name.startswith("accelerometer")}
        words = said(unjudged(self._nominal, axes))
        return (ChannelQuality(VIBRATION, Quality.ABSENT, 0, words),) if words else ()

    def finish(self) -> tuple[Record, ...]:
        """The input has ended: report counters and shares that have changed."""
        order = self._chain.order
        if order.last_ns is None or not (order.unsaid or self._chain.stream.ledger.unsaid):
            return ()
        return (self._quality(order.last_ns),)

    def reset(self) -> tuple[Record, ...]:
        """Close the open episode, if any, and arm again."""
        self._replay.forget()
        chain = self._chain
        if not chain.episode.is_open or chain.order.last_ns is None:
            return ()
        chain.stream.turn(opened=False)
        chain.wiring.again(chain.order.last_ns, deviates=False)
        return (chain.episode.close(chain.order.last_ns, "reset"),)


def _are_others(before: ChannelTable | None, table: ChannelTable) -> bool:
    """Whether a channel table is of another unit than the one before: no serial number is left."""
    known, named = ({row.serial for row in each.channels if row.serial} if each else set()
                    for each in (before, table))  # fmt: skip
    return bool(known and named) and known.isdisjoint(named)
