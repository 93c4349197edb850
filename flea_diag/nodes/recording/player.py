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

"""``ros2 run flea_diag player``: the stand's topics of a bag, played to the diagnosis."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.bus import Bus, Consumers, Program, named
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Health,
    Level,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)

TICK_S = 0.01
"""Period of publishing; also that of /clock."""
HEALTH_S = 1.0
MOST_AT_ONCE_NS = 200_000_000
"""Span of the bag published at once, whatever the speed: more would overrun the queues."""
STREAMS = (VibrationBlock, Scan, ChannelTable)
"""In this order: who knows the writer of the channel table knows those of the streams."""
SOURCES = (*STREAMS, Truth)
"""What a stand sends. Recorded verdicts would interfere with the new ones."""


@dataclass(frozen=True)
class PlayerParameters:
    """Parameters of the player."""

    bag: str = parameter("", "bag to play: a folder of rosbag2 or an .mcap file", read_only=True)
    rate: float = parameter(
        1.0, "speed: 1 is as recorded", minimum=0.01, maximum=1000.0, read_only=True
    )
    beside: bool = parameter(
        False, "play although another node publishes the same stand", read_only=True
    )
    loop: bool = parameter(False, "begin again after the last record", read_only=True)
    wait_for: str = parameter(
        "",
        "nodes that must be active before the first record, such as diagnoser or "
        "observer,isolator,extractor; the player ends once they have said their last verdict",
        read_only=True,
    )
    wait_s: float = parameter(
        300.0, "how long they are waited for", unit="s", minimum=0.0, read_only=True
    )


class Player:
    """Publishes the records of a bag at their log times, and the time of the bag as /clock.

    Parameters
    ----------
    bus
        Bus of the node.
    parameters
        Bag, speed, and whom to wait for.
    """

    def __init__(self, bus: Bus[PlayerParameters], parameters: PlayerParameters) -> None:
        self._bus, self._parameters = bus, parameters
        self._reader = opened(parameters.bag)
        self._records: Iterator[tuple[int, Record]] = iter(())
        self._next: tuple[int, Record] | None = None
        self._first_ns: int | None = None
        self._begin_s = 0.0
        self._published_ns = 0
        self._paused_s: float | None = None
        self._played = 0
        self._ended = self._greeted = False
        bus.advertise(*SOURCES, Health)
        self._consumers = Consumers(bus, named(parameters.wait_for), parameters.wait_s, STREAMS)
        bus.on("deactivate", self._pause)
        bus.on("activate", self._resume)
        bus.every(TICK_S, self._tick)
        bus.every(HEALTH_S, self._report)

    def _tick(self) -> None:
        """Publish all that is due."""
        if self._ended:
            if self._consumers.done():
                self._bus.end()
            return
        if self._first_ns is None:
            if self._consumers.ready():
                self._begin()
            return
        if not self._acknowledged():
            return
        now_ns = self._due_ns()
        self._bus.publish_clock(now_ns)
        while self._next is not None and self._next[0] <= now_ns:
            self._publish()
        if self._next is None:
            self._end()

    def _acknowledged(self) -> bool:
        """Whether all readers have what precedes the first scan; until then time stands still."""
        if not self._greeted and self._consumers.acknowledged(ChannelTable):
            self._greeted, self._begin_s = True, time.monotonic()
        return self._greeted

    def _refuse_beside(self) -> None:
        """End where a live stand publishes the same topics: two sources are none."""
        own = "/" + self._bus.name
        others = [name for name in self._bus.sources(Scan) if name != own]
        if others and not self._parameters.beside:
            raise ConfigurationError(
                f"{self._bus.full_name(Scan)} is published by {', '.join(others)}: a bag beside a "
                "live stand mixes two sources; end that node, play in another namespace "
                "(-r __ns:=/replay), or set beside:=true"
            )

    def _begin(self) -> None:
        self._refuse_beside()
        self._records = self._reader.records(SOURCES, self._namespace())
        self._next = next(self._records, None)
        if self._next is None:
            raise RecordingError(f"{self._reader.path} contains no record of a stand")
        self._first_ns, self._begin_s = self._next[0], time.monotonic()
        self._published_ns = self._first_ns
        while self._next is not None and isinstance(self._next[1], ChannelTable | Truth):
            self._publish()
        rate = self._parameters.rate
        self._bus.info(f"playing {self._reader.path} at {rate:g} times the recorded speed")

    def _publish(self) -> None:
        """Publish the next record."""
        assert self._next is not None
        self._bus.publish(self._next[1])
        self._played += 1
        self._next = next(self._records, None)

    def _namespace(self) -> str | None:
        """That of this node if the bag has it; else that of the bag, if it has but one."""
        own = self._bus.name.rpartition("/")[0]
        known = self._reader.namespaces
        return own if own in known or len(known) > 1 else known[0]

    def _now_ns(self) -> int:
        """Present time of the bag."""
        assert self._first_ns is not None
        elapsed_s = time.monotonic() - self._begin_s
        return self._first_ns + int(elapsed_s * self._parameters.rate * 1e9)

    def _due_ns(self) -> int:
        """Time of the bag to publish up to; after a pause of this process the rest of it slips."""
        now_ns = self._now_ns()
        late_ns = now_ns - self._published_ns - MOST_AT_ONCE_NS
        if late_ns > 0:
            self._begin_s += late_ns / 1e9 / self._parameters.rate
            now_ns -= late_ns
        self._published_ns = now_ns
        return now_ns

    def _end(self) -> None:
        self._bus.info(f"{self._played} records played")
        if self._parameters.loop:
            self._begin()
        else:
            self._ended = True

    def _pause(self) -> None:
        self._paused_s = time.monotonic()
        self._bus.caution("deactivated: the bag pauses until the node is activated again")

    def _resume(self) -> None:
        if self._paused_s is not None:
            self._begin_s += time.monotonic() - self._paused_s
        self._paused_s = None

    def _report(self) -> None:
        waiting = self._first_ns is None
        if not waiting and not self._ended:
            self._refuse_beside()
        words = "waiting" if waiting else "bag is over" if self._ended else "playing"
        values = (("state", self._bus.state), ("records", str(self._played)))
        self._bus.publish(Health(self._bus.now_ns(), self._bus.name, Level.OK, words, values))


def opened(bag: str) -> BagReader:
    """Reader of the bag to play.

    Raises
    ------
    ConfigurationError
        No bag is named.
    RecordingError
        It is no bag with topics of a stand.
    """
    if not bag:
        raise ConfigurationError("bag = '': name the bag to play, for example bag:=bags/jam")
    return BagReader(Path(bag))


def start(bus: Bus[Any], parameters: PlayerParameters) -> None:
    """Play as soon as the node is active."""
    Player(bus, parameters)


def check(parameters: PlayerParameters) -> None:
    """Refuse what is no bag."""
    opened(parameters.bag)


def program() -> Program:
    """Description of this node."""
    return Program(
        "player",
        "Plays what a stand sent from a bag, once the diagnosis is ready; recorded verdicts are "
        "left out, for the diagnosis is made anew.",
        PlayerParameters,
        start,
        subscribes=(AmbiguityGroup,),
        publishes=(*SOURCES, Health),
        examples=(
            "ros2 run flea_diag player --ros-args -p bag:=bags/jam -p wait_for:=diagnoser",
            "ros2 run flea_diag player --ros-args -p bag:=bags/jam -p rate:=4.0",
        ),
        check=check,
    )
