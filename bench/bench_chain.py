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

"""Latency and CPU of the one-process diagnoser compared with an empty rclpy node.

The empty node is a plain rclpy program: default executor, message classes, and one JointState per
scan with the names of the diagnoser's own residual. What the diagnoser sends besides, once a second
or on change, it does not send. Both receive the same scans at the same time, 100 per second, in
alternating order, so that other load on the machine affects both equally. Latency is from the
publication of a scan to the arrival of the resulting record in this process.

    scripts/bench chain
"""

from __future__ import annotations

import struct
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

import numpy as np
from bench_scan import pipeline, recording
from bench_stand import cpu_s
from summary import Figure, bench_parser, write_summary
from support.live import Peer, Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.messages import codec
from flea_diag.wire.records import ChannelTable, Residual, Scan

PERIOD_S = 0.01
SECONDS = 40
SETTLE = 1000
LIMIT = 2.0
NAMES = ("empty", "diagnoser")


def empty() -> None:
    """Node that answers each scan with a JointState of the size of a residual, without work."""
    import rclpy
    from sensor_msgs.msg import JointState

    rclpy.init()
    me = rclpy.create_node("empty", namespace=NAMES[0])
    out = me.create_publisher(JointState, "residual", 100)
    names = sys.argv[2].split(",")
    numbers = [0.0] * len(names)

    def answer(scan: JointState) -> None:
        out.publish(JointState(header=scan.header, name=names, position=numbers))

    me.create_subscription(JointState, "sensors/slow", answer, 100)
    rclpy.spin(me)


def residual_names(table: ChannelTable, scans: list[Scan]) -> str:
    """Names in the message of a residual, separated by commas."""
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    stage = pipeline("particle", "auto")
    stage.handle(table)
    said = [record for scan in scans[:SETTLE] for record in stage.handle(scan)]
    last = next(record for record in reversed(said) if isinstance(record, Residual))
    return ",".join(deserialize_message(codec.encode(last), JointState).name)


def measured(table: ChannelTable, scans: list[Scan]) -> dict[str, tuple[float, float]]:
    """Median latency, s, and CPU per scan, s, of both nodes."""
    commands = (
        [sys.executable, __file__, "--empty", residual_names(table, scans)],
        node("diagnoser", "-r", f"__ns:=/{NAMES[1]}"),
    )
    sent, heard = ({name: np.full(len(scans), np.nan) for name in NAMES} for _ in range(2))
    numbers = {scan.stamp_ns: number for number, scan in enumerate(scans)}
    with (
        reserved_domain() as domain,
        Process(commands[0], domain) as one,
        Process(commands[1], domain) as other,
        Peer(domain, NAMES[1]) as peer,
    ):
        out = {name: joined(peer, name, heard[name], numbers) for name in NAMES}
        for publisher in out.values():
            peer.until(lambda publisher=publisher: publisher.get_subscription_count() > 0, 60.0)
        peer.bus.publish(table)  # latched: late joiners receive it too
        rest, spent = iter(enumerate(scans)), [0.0, 0.0]

        def send() -> None:
            number, scan = next(rest, (len(scans), None))
            if scan is None:
                return
            if number == SETTLE:
                spent[:] = [cpu_s(process.child.pid) for process in (one, other)]
            data = codec.encode(scan)
            for name in NAMES if number % 2 else NAMES[::-1]:
                sent[name][number] = time.perf_counter()
                out[name].publish(data)

        peer.bus.every(PERIOD_S, send)
        peer.until(lambda: all(np.isfinite(arrived[-1]) for arrived in heard.values()), 300.0)
        used = [cpu_s(process.child.pid) for process in (one, other)]
    each = (np.subtract(used, spent) / (len(scans) - SETTLE)).tolist()
    took = [float(np.nanmedian((heard[name] - sent[name])[SETTLE:])) for name in NAMES]
    return dict(zip(NAMES, zip(took, each, strict=True), strict=True))


def joined(peer: Peer, name: str, heard: np.ndarray, numbers: dict[int, int]) -> Any:
    """Subscribe to the answers of one node; return the publisher of its scans."""
    from sensor_msgs.msg import JointState

    def arrived(data: bytes) -> None:
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)  # the header's stamp
        heard[numbers[1_000_000_000 * seconds + nanoseconds]] = time.perf_counter()

    peer.node.create_subscription(JointState, f"/{name}/residual", arrived, 100, raw=True)
    return peer.node.create_publisher(JointState, f"/{name}/sensors/slow", 100)


def main() -> None:
    """Print latency and CPU of both, and their ratios."""
    arguments = bench_parser(__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bag = recording(Path(folder), SECONDS)
        records = [record for _, record in BagReader(bag).records((ChannelTable, Scan))]
    table = next(record for record in records if isinstance(record, ChannelTable))
    found = measured(table, [record for record in records if isinstance(record, Scan)])
    print(f"{'':12s}{'latency, us':>14s}{'CPU a scan, us':>18s}")
    for name, (latency, cpu) in found.items():
        print(f"{name:12s}{latency * 1e6:14.0f}{cpu * 1e6:18.0f}")
    ratios = [mine / plain for plain, mine in zip(*found.values(), strict=True)]
    print(f"{'ratio':12s}{ratios[0]:14.2f}{ratios[1]:18.2f}   (limit {LIMIT})")
    figures = [
        Figure(f"diagnoser, {what}", ratio, "x", SECONDS * 100 - SETTLE, seed="21",
               against="an empty rclpy node, same scans")
        for what, ratio in zip(("latency", "CPU a scan"), ratios, strict=True)
    ]  # fmt: skip
    write_summary("chain", figures, arguments.json)


if __name__ == "__main__":
    empty() if "--empty" in sys.argv else main()
