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

"""What a stage says, as published: numbered, repeated, mirrored on /diagnostics and logged."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.nodes.health import HealthReport
from flea_diag.nodes.stage.channel_age import stopped
from flea_diag.nodes.stage.malformed import with_malformed
from flea_diag.nodes.stage.record_log import RecordLog
from flea_diag.nodes.stage.stand_diagnostics import MIRRORED, mirrored, serial_of
from flea_diag.nodes.stage.verdict import NumberedVerdict
from flea_diag.wire.blocks import Block, ResidualBlock
from flea_diag.wire.bus import Bus
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    JudgedTest,
    Record,
    Residual,
    VibrationLevel,
)

JUDGED_NS = 5_000_000_000
"""Shares of judgement are said at most so often while nothing else changes."""
NUMBERS: tuple[type, ...] = (Residual, VibrationLevel)
"""Records of each scan or block: published, and neither logged nor repeated."""


class StageOutput:
    """Publishes the records of a stage on the bus of its node.

    Parameters
    ----------
    bus
        Bus of the node.
    health
        Says whether the source is silent.
    keep
        Takes each verdict before it is published.
    """

    def __init__(
        self, bus: Bus[Any], health: HealthReport, keep: Callable[[AmbiguityGroup], None]
    ) -> None:
        self._bus, self._health, self._keep = bus, health, keep
        self._verdict = NumberedVerdict()
        self._log = RecordLog(bus)
        self._mirrored: dict[type, Record] = {}
        self._quality: DataQuality | None = None
        """Data quality as the stage last said it."""
        self._malformed_said = 0
        self._judged_said: tuple[JudgedTest, ...] = ()
        self._judged_said_ns = NEVER_NS
        self._serial = ""
        self._stopped = False
        """Whether data quality was last said to be stale."""

    def take_table(self, table: ChannelTable) -> None:
        """Note the serial of the actuator that the statuses are on."""
        self._serial = serial_of(table)

    def publish(self, records: tuple[Record | Block, ...]) -> None:
        """Publish what the stage has just said."""
        for record in records:
            if isinstance(record, ResidualBlock):
                self._bus.publish_block(record)
                continue
            if isinstance(record, NUMBERS):
                self._bus.publish(record)
                continue
            if isinstance(record, AmbiguityGroup):
                record = self._verdict.changed(record, self._health.silent)
                self._keep(record)
                self._publish_verdict(record)
            elif isinstance(record, DataQuality):
                self._quality = record
                record = self._publish_quality(record)
            else:
                self._bus.publish(record)
            self._log.add(record)
            self._mirror(record)

    def repeat(self, quality: DataQuality | None = None) -> None:
        """Publish again how things stand, and what could not be read since.

        ``quality`` is that of now: its ages and shares go to /diagnostics, the shares from time to
        time to whoever reads data_quality.
        """
        self._quality = quality or self._quality
        if self._quality is not None:
            self._mirrored[DataQuality] = self._as_it_is(self._quality)
        if self._quality is not None and self._is_due(self._quality):
            self._mirror(self._publish_quality(self._quality))
        again = self._verdict.again()
        if again is not None:
            self._publish_verdict(again)
        for record in self._mirrored.values():
            self._show(record)

    def note_silence(self) -> None:
        """Mark the verdict stale when the source has stopped, and sound when it goes on."""
        silent = self._health.silent
        if self._quality is not None and silent != self._stopped:
            self._mirror(self._publish_quality(self._quality))
        changed = self._verdict.source_silent(silent)
        if changed is not None:
            self._publish_verdict(changed)
            if changed.stale:
                self._bus.caution("the source has stopped: the last verdict is repeated as stale")
            else:
                self._mirror(changed)

    def pause(self) -> None:
        """Mark the verdict stale: nothing is judged until the node is activated again."""
        changed = self._verdict.source_silent(True)
        if changed is not None:
            self._publish_verdict(changed)

    def forget(self) -> None:
        """Forget what was said of the run so far."""
        self._verdict.forget()
        self._quality, self._stopped = None, False
        self._judged_said, self._judged_said_ns = (), NEVER_NS
        self._mirrored.clear()

    def _publish_quality(self, quality: DataQuality) -> DataQuality:
        """Publish data quality with what this node could not read, and return that."""
        whole, self._stopped = self._as_it_is(quality), self._health.silent
        self._malformed_said = self._malformed
        self._judged_said, self._judged_said_ns = whole.judged, whole.stamp_ns
        self._bus.publish(whole)
        return whole

    def _is_due(self, quality: DataQuality) -> bool:
        """Whether nobody has been told of messages that are not used, or of the latest shares."""
        if self._malformed > self._malformed_said:
            return True
        moved = quality.judged != self._judged_said
        since_ns = quality.stamp_ns - self._judged_said_ns
        return moved and not 0 <= since_ns < JUDGED_NS and not self._health.silent

    def _as_it_is(self, quality: DataQuality) -> DataQuality:
        """Data quality with what this node could not read, and stale if the source has stopped."""
        whole = with_malformed(quality, self._bus.streams.values())
        return stopped(whole, self._health.silent_s) if self._health.silent else whole

    @property
    def _malformed(self) -> int:
        """Messages that were not used."""
        return sum(stream.malformed + stream.foreign for stream in self._bus.streams.values())

    def _publish_verdict(self, group: AmbiguityGroup) -> None:
        for record in self._verdict.messages(group, self._bus.stand):
            self._bus.publish(record)

    def _mirror(self, record: Record) -> None:
        """Publish a changed state on /diagnostics; it is repeated every second."""
        if isinstance(record, MIRRORED):
            self._mirrored[type(record)] = record
            self._show(record)

    def _show(self, record: Record) -> None:
        """A status that nobody repeats goes stale by itself where it is shown."""
        if isinstance(record, MIRRORED) and not self._health.silent:
            now_ns, live = self._bus.now_ns(), not self._bus.replays
            self._bus.publish(mirrored(record, self._bus.name, now_ns, self._serial, live))
