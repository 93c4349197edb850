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

"""A recorder as a process, and what is sent to it."""

from __future__ import annotations

from pathlib import Path

from flea_diag.wire.records import ChannelInfo, ChannelTable, Health, Scan, VibrationBlock
from support.live import Peer, node

START_NS = 1_700_000_000 * 10**9
TABLE = ChannelTable(START_NS, "toy", (ChannelInfo("motor_current", "A", -10.0, 10.0, 100.0),))


def recorder(directory: Path, *arguments: str) -> list[str]:
    return node("recorder", "-p", f"directory:={directory}", *arguments)


def scan(number: int) -> Scan:
    return Scan(START_NS + number * 10_000_000, ("motor_current",), (float(number),))


def publish(peer: Peer, count: int) -> None:
    assert peer.heard(Scan, ChannelTable, VibrationBlock)
    peer.bus.publish(TABLE)
    for number in range(count):
        peer.bus.publish(scan(number))


def until_written(peer: Peer, messages: int) -> None:
    """Wait until the recorder reports them: it does after it made the bag whole."""
    peer.until(
        lambda: any(
            isinstance(r, Health) and int(dict(r.values).get("messages", "0")) >= messages
            for r in peer.records
        )
    )


def opened(directory: Path) -> dict[str, int]:
    """Message counts as an independent reader of rosbag2 bags sees them."""
    from rosbags.highlevel import AnyReader

    with AnyReader([directory]) as reader:
        return {
            connection.topic: sum(1 for _ in reader.messages([connection]))
            for connection in reader.connections
        }
