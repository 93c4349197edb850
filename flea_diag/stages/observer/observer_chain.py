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

"""Processing chain of the observer on one stream of scans, with all of its state.

Order of the stream (``stream_order``), usable readings (``channels``), change of the unit
(``unit_change``), residuals and their tests (``residual_stream``), symbols of the open episode
(``detection_episode``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.likelihood.effect_set import EffectSet
from flea_diag.core.sensors.unit_change import UnitChange
from flea_diag.core.wiring.wiring_search import WiringSearch
from flea_diag.stages.observer.channels import ChannelReadings, Channels
from flea_diag.stages.observer.detection_episode import DetectionEpisode
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.observer.regressor_table import Answer, RegressorTable
from flea_diag.stages.observer.residual_stream import ResidualStream, StreamOutput
from flea_diag.stages.observer.residual_tests import ResidualTests, SensorTestsAlone
from flea_diag.stages.observer.state_estimate import StateEstimate
from flea_diag.stages.stream.stream_order import StreamOrder
from flea_diag.stages.wiring.stream_wiring import StreamWiring
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import ChannelQuality, ChannelTable, Record


class ObserverChain:
    """All state of the observer that a scan changes; a deep copy of it is a checkpoint."""

    def __init__(
        self, calibration: Calibration, effects: EffectSet, parameters: ObserverParameters,
        answers: Sequence[Answer] | None = None,
    ) -> None:  # fmt: skip
        self._calibration = calibration
        self._answers = answers
        self._effects = effects
        self._parameters = parameters
        self.order = StreamOrder(round(calibration.period_s * 1e9), parameters.gap_scans)
        rows = effects.residuals
        self._temperatures = np.array([rows.index[name] for name in effects.temperatures], int)
        self.episode = self._detection()
        self._unit = UnitChange()
        columns = RegressorTable(effects, calibration.parameters).rows
        self._search = WiringSearch(effects, calibration, columns)
        self._renew()

    def _detection(self) -> Any:
        """What detects: takes residuals, and keeps the open episode."""
        return DetectionEpisode(self._effects.residuals, self._parameters.rearm_after_s)

    def begin(self, stamp_ns: int, table: ChannelTable | None) -> None:
        """Start a new stream; only counters of the stream order are kept."""
        if self.stream.begun:
            self._renew()
        if table is not None:
            self.take_ranges(table)
        self.stream.begin(stamp_ns)

    def _renew(self) -> None:
        """Build what holds the state of a stream: done before its first scan, which waits less."""
        c, p = self._calibration, self._parameters
        distrust = f"disagrees with current and motion by more than {c.voltage_limit_v:.1f} V"
        self.channels = Channels(
            self._effects.residuals, c.channels, distrust, p.observer_backend, counts=c.counts
        )
        estimate = StateEstimate(
            c, self._effects.relations, p.state_observer, p.observer_seed, p.observer_backend
        )
        self.stream = ResidualStream(
            c, self._effects, estimate, p.warm_up_s, p.observer_backend, self._answers,
            self._tests(estimate.runs),
        )  # fmt: skip
        self.wiring = StreamWiring(self._search, c.counts, c.period_s)
        self.episode.forget()
        self._unit.forget()

    def _tests(self, estimates: bool) -> ResidualTests | SensorTestsAlone:
        """Tests of the residuals of one stream."""
        p = self._parameters
        relations = self._effects.relations
        return ResidualTests(relations, self._calibration, estimates, p.observer_backend)

    def take_ranges(self, table: ChannelTable) -> None:
        """Use the ranges of a channel table."""
        self.channels.take_ranges(table)
        self.stream.take_ranges(table)

    def leading(self, block: ScanBlock) -> int:
        """How many scans of a block may be followed as one."""
        return min(self.order.leading(block.stamps_ns), self.stream.leading(block.stamps_ns))

    def follow(self, block: ScanBlock) -> tuple[int, StreamOutput]:
        """Take scans in order: the first that causes more than residuals (or n), and the output."""
        self.order.follow(block.stamps_ns)
        reading = self.channels.read(block)
        changed, output = self.examine(block, reading)
        happens = self.happens(block, output)
        other, wiring = self.other_unit(reading), self.watch_wiring(block, reading, output)
        first = min(changed, output.voltage.lost_at, output.turn, happens, other, wiring)
        return first, output

    def happens(self, block: ScanBlock, output: StreamOutput) -> int:
        """The first scan with which the detection causes a record, or n."""
        first: int = self.episode.follow(block.stamps_ns, output.results)
        return first

    def detect(self, block: ScanBlock, output: StreamOutput) -> tuple[Record, ...]:
        """Records of the detection that one scan causes."""
        (stamp_ns,) = block.stamps_ns.tolist()
        before = self.episode.goes_on
        found: tuple[Record, ...] = self.episode.step(stamp_ns, output.results)
        if self.stream.conditions.begins is not None:
            found += self.episode.take_back(stamp_ns, self.stream.conditions.begins)
        if self.episode.goes_on != before:
            self.stream.thaw(self.episode.goes_on)
        return found

    @property
    def told(self) -> bool:
        """Whether the last scan has changed what is reported beside channels."""
        return self.stream.told

    def states(self) -> tuple[ChannelQuality, ...]:
        """Rows of DataQuality beside those of channels."""
        return (*self.stream.states(), *self.wiring.states())

    def watch_wiring(self, block: ScanBlock, reading: ChannelReadings, output: StreamOutput) -> int:
        """The first scan at which the wiring is to be looked at, or n."""
        moving = output.residuals.moving
        if output.results.void or self.order.rate.off_hz:
            moving = np.zeros_like(moving)
        return self.wiring.follow(block.stamps_ns, reading.raw, reading.usable, moving)

    def other_unit(self, reading: ChannelReadings) -> int:
        """The first scan at which another unit is in use, or n."""
        return self._unit.follow(reading.usable.take(self._temperatures, axis=1))

    @property
    def freezes(self) -> bool:
        """Whether corrections of what is predicted stand still."""
        return bool(self.episode.is_open)

    def examine(self, block: ScanBlock, reading: ChannelReadings) -> tuple[int, StreamOutput]:
        """The first scan at which a channel changes its state, or n; residuals and tests of all."""
        output = self.stream.step(block.stamps_ns, reading.raw, reading.usable, self.freezes)
        if self.order.rate.off_hz:
            output.results.z.fill(np.nan)  # derivatives and windows count scans
        return self.channels.judge(block.stamps_ns, reading, output.voltage.trusted), output
