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

"""Load generator of bench_fleet.py: a process that publishes prepared messages to many stands."""

from __future__ import annotations

import struct
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.messages import codec
from flea_diag.wire.records import ChannelTable, Scan, VibrationBlock
from flea_diag.wire.topics import TOPIC_OF

PERIOD_S = 0.01
JAMMED = 8
"""One stand in so many jams."""
STAMP = struct.Struct("<iI")
STAMP_AT = 4
READY = "publishers are connected"


def names(count: int) -> list[str]:
    """Namespaces of the stands."""
    return [f"bay_{number}" for number in range(count)]


@dataclass(frozen=True)
class Prepared:
    """Messages of one topic, encoded, with the time at which each is due."""

    record_type: type
    due_s: list[float]
    rows: list[bytearray]

    @classmethod
    def of(cls, bag: Path, record_type: type) -> Prepared:
        """The messages of a recording."""
        found = [record for _, record in BagReader(bag).records((record_type,))]
        due_s = [(record.stamp_ns - found[0].stamp_ns) / 1e9 for record in found]
        return cls(record_type, due_s, [bytearray(codec.encode(record)) for record in found])


def generate(count: int, folder: Path, seconds: float, vibration: bool) -> None:
    """Publish prepared messages, stamped with the time at which each is due; the load generator."""
    import rclpy

    kinds = (Scan, VibrationBlock) if vibration else (Scan,)
    sound, jammed = (
        [Prepared.of(folder / name, kind) for kind in kinds] for name in ("sound", "jammed")
    )
    rclpy.init()
    me = rclpy.create_node("generator")
    table = next(row for _, row in BagReader(folder / "sound").records((ChannelTable,)))
    out = [
        (publisher_of(me, name, each.record_type), each)
        for number, name in enumerate(names(count))
        for each in (jammed if number % JAMMED == 0 else sound)
    ]
    tables = [(publisher_of(me, name, ChannelTable), codec.encode(table)) for name in names(count)]
    for publisher, data in tables:  # latched, as a stand says once what its channels are
        publisher.publish(data)
    while not all(publisher.get_subscription_count() for publisher, _ in (*out, *tables)):
        time.sleep(0.05)
    time.sleep(1.0)  # a writer knows its reader before the reader knows the writer
    print(READY, flush=True)
    publish(out, seconds)
    print("all published", flush=True)
    rclpy.spin(me)  # what is not acknowledged yet is sent again, until this process is ended


def publisher_of(node: Any, name: str, record_type: type) -> Any:
    """Publisher of one topic of a stand."""
    from rclpy.qos import DurabilityPolicy, QoSProfile

    topic = TOPIC_OF[record_type]
    kept = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    quality = QoSProfile(depth=topic.depth if topic.latched else 100, durability=kept)
    return node.create_publisher(codec.message_class(record_type), f"/{name}/{topic.name}", quality)


def publish(out: list[tuple[Any, Prepared]], seconds: float) -> None:
    """Publish what is due, a hundred times a second."""
    begin, begin_ns = time.monotonic(), time.time_ns()
    following = [0] * len(out)
    for number in range(round(seconds / PERIOD_S)):
        now_s = number * PERIOD_S
        time.sleep(max(0.0, begin + now_s - time.monotonic()))
        for k, (publisher, each) in enumerate(out):
            while (at := following[k]) < len(each.rows) and each.due_s[at] < now_s + PERIOD_S / 2:
                stamp = divmod(begin_ns + round(1e9 * each.due_s[at]), 1_000_000_000)
                STAMP.pack_into(each.rows[at], STAMP_AT, *stamp)
                publisher.publish(bytes(each.rows[at]))
                following[k] += 1
