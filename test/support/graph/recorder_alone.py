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

"""A recorder and a source in a simulated graph, on a disk whose n-th operation fails."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from flea_diag.errors import FleaError, line_of
from flea_diag.nodes.recording import recorder
from flea_diag.wire.bus import qos
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Scan
from flea_diag.wire.topics import TOPIC_OF
from support.disk.failing_disk import FULL, FailingDisk
from support.graph.judged import missing_from
from support.graph.network import Network
from support.graph.process import GraphProcess
from support.graph.ros_node import RosNode
from support.graph.scheduler import S, Scheduler

SCANS, PERIOD_NS = 75, 20_000_000


@dataclass(frozen=True)
class Recorded:
    """What became of it: operations of the disk, the one that failed, and what is wrong."""

    count: int
    operation: str
    wrong: tuple[str, ...]


def recorded(number: int, folder: Path) -> Recorded:
    """Record a second and a half, three writes; the operation of this number fails, 0 is none."""
    scheduler = Scheduler(number)
    network, begun_ns = Network(scheduler), scheduler.now_ns
    failed_ns: list[int] = []

    def fails(count: int, _name: str) -> int:
        if count == number:
            failed_ns.append(scheduler.now_ns)
        return FULL if count == number else 0

    taken: list[tuple[str, bytes, int]] = []
    network.took = lambda reader, data: taken.append((reader.topic, data, scheduler.now_ns))
    disk = FailingDisk(folder, fails)
    with scheduler.as_time(), disk.in_use():
        values = {"directory": str(folder / "bag_0"), "stop_free_mb": 0}
        process = GraphProcess(network, recorder.program(), values)
        _source(network, begun_ns + S)
        scheduler.run_until(begun_ns + 5 * S)
        process.end()
    return Recorded(disk.count, "".join(disk.failed), (
        *_ended(process, bool(disk.failed)), *missing_from(folder, taken, failed_ns, begun_ns)
    ))  # fmt: skip


def _source(network: Network, from_ns: int) -> None:
    topic = TOPIC_OF[Scan]
    writer = RosNode(network, "stand").create_publisher(
        None, topic.name, qos.reliable(topic.depth, topic.latched)
    )
    scan = Scan(0, ("motor_current",), (1.0,))
    for number in range(SCANS):
        at_ns = from_ns + number * PERIOD_NS
        data = codec.encode(replace(scan, stamp_ns=at_ns))
        network.scheduler.at(at_ns, lambda data=data: writer.publish(data))


def _ended(process: GraphProcess, disk_failed: bool) -> tuple[str, ...]:
    """It ends with one line that names the bag; where nothing failed it does not."""
    ended = process.node.raised or process.finished.value
    if not disk_failed:
        return () if ended is None else (f"ended: {ended}",)
    if (
        not isinstance(ended, FleaError)
        or line_of(ended) != str(ended)
        or "bag_0" not in str(ended)
    ):
        return (f"ended with {type(ended).__name__}: {ended}",)
    return ()
