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

"""The bridge with ten topics at 100 Hz beside the diagnoser: CPU of both, and the same decisions.

python bench/stands/bench_bridge.py

A recording with a short circuit of the winding is published in real time as ten topics of
sensor_msgs/Temperature, which has a stamp and a number, one channel each. The bridge makes scans of
them, which the diagnoser diagnoses. The same messages in a bag go through ``flea import`` and
``flea replay``: scans and the last group must be the same.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench"), str(ROOT / "test")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench_stand import cpu_s
from summary import Figure, bench_parser, write_summary
from support.foreign import arm
from support.live import Peer, Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.tools.main import main as flea
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Scan

BAG = ROOT / "bags/winding_short"
TOPICS, PERIOD_NS, SETTLED = 10, 10_000_000, 300
"""Topics, their period, and the scan from which on CPU is counted."""
RELIABLE = "qos_overrides.{}.subscription.reliability:=reliable"


def channels() -> tuple[list[str], list[tuple[float, ...]], dict[str, dict[str, object]]]:
    """Names of the channels, their values by scan, and where they come from."""
    records = [record for _, record in read_bag(BAG, (ChannelTable, Scan))]
    rows = next(r for r in records if isinstance(r, ChannelTable)).channels
    scans = [r for r in records if isinstance(r, Scan)]
    names = list(scans[0].channels[:TOPICS])
    known = {row.name: row for row in rows}
    sources: dict[str, dict[str, object]] = {
        name: {
            "topic": f"/bench/{name}", "type": arm.TEMPERATURE, "field": "temperature",
            "unit": known[name].unit, "range": [known[name].minimum, known[name].maximum],
            "sampling": known[name].sampling,
        }
        for name in names
    }  # fmt: skip
    return names, [scan.values[:TOPICS] for scan in scans], sources


def live(stand: Path, start_ns: int) -> tuple[list[Scan], AmbiguityGroup, list[float]]:
    """Scans and the last verdict, and the share of a core of bridge, diagnoser and this process."""
    from sensor_msgs.msg import Temperature

    names, rows, _ = channels()
    reliable = [part for n in names for part in ("-p", RELIABLE.format(f"/bench/{n}"))]
    bridge = node("bridge", "-p", f"stand:={stand}", *reliable)
    diagnoser = node("diagnoser", "-p", f"stand:={stand}", "-p", "memory:=none")
    scans: list[Scan] = []
    groups: list[AmbiguityGroup] = []
    with (
        reserved_domain() as domain,
        Peer(domain) as peer,
        Process(diagnoser, domain) as judge,
        Process(bridge, domain) as maker,
    ):
        writers = [peer.node.create_publisher(Temperature, f"/bench/{n}", 100) for n in names]
        peer.bus.subscribe(Scan, scans.append)
        peer.bus.subscribe(AmbiguityGroup, groups.append)
        peer.until(lambda: all(w.get_subscription_count() for w in writers))
        peer.until(lambda: peer.node.count_subscribers("sensors/slow") > 1)
        pids = maker.child.pid, judge.child.pid, os.getpid()
        begin, begun, first = [0.0, 0.0, 0.0], 0.0, time.monotonic()
        for number, row in enumerate(rows):
            due = first + 1e-9 * PERIOD_NS * number
            peer.bus.wait_until(lambda due=due: time.monotonic() >= due, 1.0)
            if number == SETTLED:
                begin, begun = [cpu_s(pid) for pid in pids], time.monotonic()
            for writer, value in zip(writers, row, strict=True):
                message = Temperature(temperature=value)
                seconds, rest = divmod(start_ns + PERIOD_NS * number, 10**9)
                message.header.stamp.sec, message.header.stamp.nanosec = seconds, rest
                writer.publish(message)
        took = time.monotonic() - begun
        shares = [(cpu_s(pid) - since) / took for pid, since in zip(pids, begin, strict=True)]
        peer.until(lambda: len(scans) >= len(rows) - 4)
        # The last one: its source has stopped.
        peer.until(lambda: bool(groups) and groups[-1].stale)
    return scans, groups[-1], shares


def sent(start_ns: int) -> Iterator[tuple[str, int, Any]]:
    """The same messages for a bag."""
    names, rows, _ = channels()
    for number, row in enumerate(rows):
        stamp_ns = start_ns + PERIOD_NS * number
        for name, value in zip(names, row, strict=True):
            message = arm.T[arm.TEMPERATURE](arm.header_at(stamp_ns), value, 0.0)
            yield f"/bench/{name}", stamp_ns, message


def imported(stand: Path, start_ns: int, folder: Path) -> tuple[list[Scan], dict[str, Any]]:
    """Scans of the import, and the verdict of the replay."""
    bag, verdict = arm.write_ros2(folder / "sent", sent(start_ns)), folder / "verdict.json"
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
        flea(["import", "--stand", str(stand), str(bag), "-o", str(folder / "bags")])
        made = folder / "bags/sent"
        flea(["replay", str(made), "--stand", str(stand), "--json", str(verdict)])
    scans = [r for _, r in read_bag(made, (Scan,)) if isinstance(r, Scan)]
    return scans, json.loads(verdict.read_text(encoding="utf-8"))


def main() -> int:
    """Run and print."""
    arguments = bench_parser(__doc__).parse_args()
    start_ns = time.time_ns() // PERIOD_NS * PERIOD_NS
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        mapping = {"schema_version": 1, "rate_hz": 1e9 / PERIOD_NS, "channels": channels()[2]}
        stand = arm.arm_stand(folder / "stand", mapping)
        scans, group, shares = live(stand, start_ns)
        expected, verdict = imported(stand, start_ns, folder)
    same = sum(repr(a) == repr(b) for a, b in zip(scans, expected, strict=False))
    members = sorted(member.fault for member in group.members)
    alike = members == sorted(verdict["ambiguity_group"]) and group.outcome == verdict["outcome"]
    n = len(expected) - SETTLED
    words = ("bridge", "diagnoser", "publisher and listener")
    for word, part in zip(words, shares, strict=True):
        print(f"{word:24s} {100.0 * part:5.1f} % of a core")
    print(f"{same} of {len(scans)} scans as imported; {group.outcome} {members}, alike: {alike}")
    load = f"diagnoser {100.0 * shares[1]:.1f} %"
    figures = [
        Figure("bridge, 10 topics at 100 Hz", 100.0 * shares[0], "% of a core", n, against=load),
        Figure("diagnoser beside it", 100.0 * shares[1], "% of a core", n),
        Figure("scans equal to those of flea import", same, "scans", len(scans)),
        Figure("verdict equal to that of flea replay", float(alike), "1"),
    ]
    write_summary("bench/stands/bench_bridge.py", figures, arguments.json)
    return 0 if alike and same == len(scans) else 1


if __name__ == "__main__":
    sys.exit(main())
