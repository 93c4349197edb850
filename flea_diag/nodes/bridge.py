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

"""``ros2 run flea_diag bridge``: a stand with topics of its own, as channels of ours."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import partial
from typing import Any

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.files import DEFAULT_STAND
from flea_diag.configuration.stand import load_stand
from flea_diag.errors import ConfigurationError, WireError
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.bus.foreign_topic import check_interface
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import ChannelTable, Health, Level, Scan, VibrationBlock
from flea_diag.wire.sources.mapping import SourceMapping
from flea_diag.wire.sources.message_terms import MessageTerms, stamp_of
from flea_diag.wire.sources.scan_grid import ScanGrid
from flea_diag.wire.sources.vibration_stream import VibrationStream

HEALTH_S = 1.0


@dataclass(frozen=True)
class BridgeParameters:
    """Parameters of the bridge."""

    stand: str = parameter(
        DEFAULT_STAND,
        "name of a shipped stand, or the folder of one as a path (./mine); its channels.yaml names "
        "the topics",
        read_only=True,
    )


class Bridge:
    """Reads the mapped topics and publishes their channels at the rate of the scans.

    Parameters
    ----------
    bus
        Bus of the node.
    mapping
        Topics and channels of the stand.
    """

    def __init__(self, bus: Bus[BridgeParameters], mapping: SourceMapping) -> None:
        self._bus, self._mapping = bus, mapping
        self._terms, self._grid = MessageTerms(mapping), ScanGrid(mapping)
        self._received: Counter[str] = Counter()
        self._before: Counter[str] = Counter()
        self._unreadable: Counter[str] = Counter()
        self._scans = 0
        self._said_slower = ""
        self._vibration = VibrationStream(mapping.axes) if mapping.vibration_topic else None
        self._blocks = 0
        bus.advertise(ChannelTable, Scan, VibrationBlock, Health)
        for topic, message in mapping.topics.items():
            bus.subscribe_foreign(topic, message, partial(self._take, topic))
        if mapping.vibration_topic:
            bus.subscribe_foreign(
                mapping.vibration_topic, mapping.axes[0].message, self._take_vibration
            )
        bus.every(HEALTH_S, self._report)

    def _take(self, topic: str, message: Any) -> None:
        stamp_ns = stamp_of(message, self._bus.now_ns())
        try:
            values = self._terms.read(topic, message)
        except WireError as error:
            self._unreadable[topic] += 1
            self._bus.warn(f"{topic}: message skipped: {error}")
            return
        if not values:
            return
        self._received[topic] += 1
        streams = self._grid.streams
        for scan in self._grid.push(stamp_ns, values):
            self._bus.publish(scan)
            self._scans += 1
        if self._grid.streams > streams:
            # Before its scans, which are yet to come: that of the stream before may be newer.
            self._bus.publish(self._mapping.channel_table(stamp_ns))

    def _take_vibration(self, message: Any) -> None:
        """Samples of accelerometers; of one topic that has channels as well, each is told once."""
        topic = self._mapping.vibration_topic
        assert self._vibration is not None
        try:
            for block in self._vibration.push(stamp_of(message, self._bus.now_ns()), message):
                self._bus.publish(block)
                self._blocks += 1
        except WireError as error:
            self._unreadable[topic] += 1
            self._bus.warn(f"{topic}: message skipped: {error}")
            return
        if topic not in self._mapping.topics:
            self._received[topic] += 1

    def _report(self) -> None:
        """Publish the health: which topics are silent, and what was left out."""
        topics = dict.fromkeys((*self._mapping.topics, self._mapping.vibration_topic))
        silent = [t for t in topics if t and self._received[t] == self._before[t]]
        self._before = self._received.copy()
        wrong = [f"no readings from {', '.join(silent)}"] if silent else []
        slower = self._slower()
        if slower != self._said_slower and slower:
            self._bus.caution(slower)
        self._said_slower = slower
        wrong += [slower] if slower else []
        level, words = (Level.WARN, "; ".join(wrong)) if wrong else (Level.OK, "bridging")
        counts = {f"{topic}/received": n for topic, n in sorted(self._received.items())}
        counts |= {f"{topic}/unreadable": n for topic, n in sorted(self._unreadable.items())}
        counts |= {name: n for name, n in self._grid.counts.items() if n}
        told = {"scans": self._scans, "vibration_blocks": self._blocks, **counts}
        values = tuple((name, str(n)) for name, n in told.items())
        report = Health(
            self._bus.now_ns(), self._bus.name, level, words, (("state", self._bus.state), *values)
        )
        self._bus.publish(report)

    def _slower(self) -> str:
        """Which channels come slower than declared, in words without a figure that changes."""
        names = self._grid.slower()
        declared = {row.channel: row.rate_hz for row in self._mapping.channels}
        told = [f"{name} at {hz:.0f} Hz, declared {declared[name]:g}" for name, hz in names.items()]
        return (
            f"readings come slower than declared, what lies between them is left out: "
            f"{', '.join(told)}; correct rate_hz in {self._mapping.where} and calibrate at that "
            "rate, or state age_s"
            if told
            else ""
        )


def live_sources(parameters: BridgeParameters) -> SourceMapping:
    """Mapping of the stand.

    Raises
    ------
    ConfigurationError
        It is refused, or names columns of tables.
    """
    mapping = channel_sources(load_stand(parameters.stand))
    if not mapping.topics or "" in mapping.topics:
        raise ConfigurationError(
            f"{mapping.where} names no topics, so there is nothing to bridge: give stand the "
            "folder of a stand whose channels come from topics (stand:=./mine)"
        )
    return mapping


def start(bus: Bus[Any], parameters: BridgeParameters) -> None:
    """Bridge as soon as the node is active."""
    mapping = live_sources(parameters)
    Bridge(bus, mapping)
    topics = ", ".join(mapping.topics)
    bus.info(f"bridging {topics} to {len(mapping.channels)} channels at {mapping.rate_hz:g} Hz")


def check(parameters: BridgeParameters) -> None:
    """Refuse a mapping that cannot be bridged, and types that are not installed."""
    mapping = live_sources(parameters)
    for message in (*mapping.topics.values(), *(axis.message for axis in mapping.axes)):
        check_interface(message)


def program() -> Program:
    """Description of this node."""
    return Program(
        "bridge",
        "Publishes the channels of a stand with topics of its own, by the channels.yaml of its "
        "folder: any installed message type, on one grid of scans.",
        BridgeParameters,
        start,
        publishes=(ChannelTable, Scan, VibrationBlock, Health),
        examples=("ros2 run flea_diag bridge --ros-args -p stand:=./mine",),
        check=check,
    )
