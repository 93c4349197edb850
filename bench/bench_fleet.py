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

"""Stands that a fleet carries: scans lost, latency, CPU and memory.

A process of its own publishes prepared scans at 100 Hz to each stand, and on request the vibration
of two accelerometers of three axes at 20 kHz; its load is stated apart. A third one, this, hears
residuals and verdicts. One stand in eight jams half way. Latency is from the stamp of a scan, the
time at which it is due, to the arrival of its residual; of a verdict from that of its evidence.
With ``--heard`` residuals of so many stands are heard, as where a page shows one of them; scans of
the others count as lost unless their stand says that it has taken them.

    scripts/bench fleet                                  1 to 32 stands, 30 s each
    python bench/bench_fleet.py --seconds 600 --stands 32 --batch-ms 50 --processes 2
    python bench/bench_fleet.py --seconds 60 --stands 100 --batch-ms 100 --processes 2 --heard 1
    python bench/bench_fleet.py --seconds 60 --stands 8 --vibration --processes 2
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "test")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from bench_flood import resident_mb
from bench_scan import recording
from bench_stand import cpu_s
from load.fleet_generator import PERIOD_S, READY, STAMP, STAMP_AT, generate, names
from summary import Figure, bench_parser, write_summary
from support.live import Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.live_run import discovery
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health

LATEST_MS = 200.0
READ_S = 0.2


@dataclass
class Heard:
    """What the stands have said."""

    residuals: Counter[str] = field(default_factory=Counter)
    latencies_ms: list[float] = field(default_factory=list)
    verdicts_ms: list[float] = field(default_factory=list)
    running: dict[str, str] = field(default_factory=dict)
    told: dict[str, dict[str, str]] = field(default_factory=dict)
    stamps: dict[str, bytes] = field(default_factory=dict)

    def join(self, me: Any, count: int, listened: int) -> None:
        """Subscribe to residuals of the first ``listened`` stands, verdicts of all, and health."""
        from diagnostic_msgs.msg import DiagnosticArray
        from sensor_msgs.msg import JointState

        def health(data: bytes) -> None:
            record = codec.decode(Health, data)
            self.running[record.node] = record.message
            self.told[record.node] = dict(record.values)

        me.create_subscription(DiagnosticArray, "/diagnostics", health, 1000, raw=True)
        for number, name in enumerate(names(count)):

            def residual(data: bytes, name: str = name) -> None:
                self.residuals[name] += 1
                self.latencies_ms.append(age_ms(data))

            def verdict(data: bytes, name: str = name) -> None:
                stamp = data[STAMP_AT : STAMP_AT + STAMP.size]
                if self.stamps.get(name) != stamp:  # a repeated one is as old as its evidence
                    self.stamps[name] = stamp
                    self.verdicts_ms.append(age_ms(data))

            if number < listened:
                me.create_subscription(JointState, f"/{name}/residual", residual, 1000, raw=True)
            group = f"/{name}/ambiguity_group"
            me.create_subscription(DiagnosticArray, group, verdict, 100, raw=True)

    def counted(self, counter: str, stands: Sequence[str] | None = None) -> int:
        """Sum of a counter over all nodes, or over the diagnosers of these stands."""
        nodes = self.told if stands is None else [f"{stand}/diagnoser" for stand in stands]
        return sum(int(self.told.get(node, {}).get(counter, 0)) for node in nodes)

    def lost(self, count: int, scans: int, listened: int) -> int:
        """Scans without a residual; of stands that are not heard, those that none has taken."""
        rest, topic = names(count)[listened:], "sensors/slow"
        taken = self.counted(f"{topic}/received", rest) - self.counted(f"{topic}/lost", rest)
        return count * scans - sum(self.residuals.values()) - taken


@contextmanager
def listener(domain: int, heard: Heard, count: int, listened: int) -> Iterator[Callable[..., None]]:
    """Join the domain; yields a function that listens until a predicate holds."""
    import rclpy
    from rclpy.experimental import EventsExecutor

    os.environ.update(discovery())
    context = rclpy.Context()
    context.init(domain_id=domain)
    me = rclpy.create_node("listener", context=context)
    heard.join(me, count, listened)
    executor = EventsExecutor(context=context)
    executor.add_node(me)

    def until(predicate: Callable[[], bool], limit_s: float) -> None:
        deadline_s = time.monotonic() + limit_s
        while not predicate() and time.monotonic() < deadline_s:
            executor.spin_once(timeout_sec=0.02)

    try:
        yield until
    finally:
        me.destroy_node()
        context.try_shutdown()


def age_ms(data: bytes) -> float:
    """Time since the stamp of a message."""
    seconds, nanoseconds = STAMP.unpack_from(data, STAMP_AT)
    return (time.time_ns() - seconds * 1_000_000_000 - nanoseconds) / 1e6


@dataclass(frozen=True)
class FleetLoad:
    """One run."""

    stands: int
    lost: int
    cpu: float
    generator_cpu: float
    memory_mb: float
    median_ms: float
    p99_ms: float
    worst_ms: float
    verdict_ms: float
    verdicts: int
    blocks: int
    blocks_lost: int
    load: float


def measured(count: int, folder: Path, asked: argparse.Namespace) -> FleetLoad:
    """Run a fleet of so many stands, spread over processes as asked."""
    seconds, processes = asked.seconds, min(asked.processes, count)
    listened = count if asked.heard is None else min(asked.heard, count)
    parts = [names(count)[k::processes] for k in range(processes)]
    given = ("-p", f"batch_ms:={asked.batch_ms}", "-p", "memory:=none")
    scans = round(seconds / PERIOD_S)
    with ExitStack() as stack:
        domain = stack.enter_context(reserved_domain())
        fleets = [
            stack.enter_context(Process(node("fleet", "-r",
                f"__node:=fleet_{k}", "-p", f"stands:={part}", *given), domain))
            for k, part in enumerate(parts)
        ]  # fmt: skip
        heard = Heard()
        until = stack.enter_context(listener(domain, heard, count, listened))
        ready = {f"fleet_{k}": f"{len(part)} of {len(part)}" for k, part in enumerate(parts)}
        until(lambda: all(heard.running.get(n, "").startswith(w) for n, w in ready.items()), 120.0)
        command = [sys.executable, __file__, "--generate", str(count), "--folder", str(folder)]
        command += ["--seconds", str(seconds), *(["--vibration"] if asked.vibration else [])]
        generator = stack.enter_context(Process(command, domain))
        generator.wait_for(READY)
        heard.latencies_ms.clear()
        pids = [fleet.child.pid for fleet in fleets]
        began = sum(map(cpu_s, pids)), cpu_s(generator.child.pid)
        ends = time.monotonic() + seconds + 2.0
        while time.monotonic() < ends:
            until(lambda: False, READ_S)
            for fleet in fleets:
                fleet.read()  # who logs into a full pipe stands still
        spent = sum(map(cpu_s, pids)) - began[0], cpu_s(generator.child.pid) - began[1]
        memory = sum(map(resident_mb, pids))
    late = np.asarray(heard.latencies_ms or [np.nan])
    return FleetLoad(
        count,
        heard.lost(count, scans, listened),
        spent[0] / (count * scans),
        100.0 * spent[1] / seconds,
        memory,
        *(float(np.percentile(late, share)) for share in (50, 99, 100)),
        max(heard.verdicts_ms, default=np.nan),
        len(heard.verdicts_ms),
        heard.counted("sensors/vibration/received"),
        heard.counted("sensors/vibration/lost"),
        os.getloadavg()[0],
    )


def figures(runs: list[FleetLoad], asked: argparse.Namespace) -> list[Figure]:
    """The rows to keep."""
    seconds, processes = asked.seconds, asked.processes
    told = f"batch_ms {asked.batch_ms}, {processes} process{'es' if processes > 1 else ''}"
    if asked.heard is not None:
        told += f", residuals of {asked.heard} heard"
    if asked.vibration:
        told += ", two accelerometers of 20 kHz"
    rows = []
    for run in runs:
        n, where = (
            round(run.stands * seconds / PERIOD_S),
            f"{run.stands} stand{'s' * (run.stands > 1)}, {told}",
        )
        rows += [
            Figure(f"{where}: scans lost", run.lost, "scans", n),
            Figure(f"{where}: CPU a scan", run.cpu * 1e6, "us", n),
            Figure(f"{where}: latency, 99 %", run.p99_ms, "ms", n, run.median_ms, run.worst_ms),
            Figure(f"{where}: latency of a verdict, worst", run.verdict_ms, "ms", run.verdicts),
            Figure(f"{where}: resident memory", run.memory_mb, "MB"),
            Figure(f"{where}: load generator", run.generator_cpu, "% of a core"),
        ]
        if asked.vibration:
            rows.append(Figure(f"{where}: vibration blocks lost", run.blocks_lost, "blocks",
                               run.blocks))  # fmt: skip
    if len(runs) > 1 and processes == 1:
        each = (runs[-1].memory_mb - runs[0].memory_mb) / (runs[-1].stands - runs[0].stands)
        rows.append(Figure("each further stand in a process", each, "MB", len(runs)))
    return rows


def main() -> None:
    """Measure, print a row for each number of stands."""
    parser = bench_parser(__doc__)
    parser.add_argument("--stands", type=int, nargs="+", default=[1, 2, 4, 8, 16, 32])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--batch-ms", type=int, default=50)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--heard", type=int, help="stands whose residuals are heard; default all")
    parser.add_argument("--vibration", action="store_true", help="two accelerometers of 20 kHz")
    parser.add_argument("--generate", type=int, help="be the load generator of so many stands")
    parser.add_argument("--folder", type=Path, help="recordings to publish; made if missing")
    given = parser.parse_args()
    if given.generate:
        generate(given.generate, given.folder, given.seconds, given.vibration)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = given.folder or Path(name)
        record(folder, given.seconds, given.vibration)
        print("stands    lost  us a scan  latency ms: median    99 %   worst   verdict      MB"
              "  generator %    load")  # fmt: skip
        runs = [shown(measured(count, folder, given)) for count in given.stands]
    write_summary("fleet", figures(runs, given), given.json)


def record(folder: Path, seconds: float, vibration: bool) -> None:
    """Simulate what the generator publishes: a sound stand, and one that jams half way."""
    length, jam = round(seconds) + 2, ("--fault", "jam", "--at", str(seconds / 2))
    for name, more in (("sound", ()), ("jammed", jam)):
        if not (folder / name).exists():
            recording(folder, length, *more, vibration=vibration).rename(folder / name)


def shown(run: FleetLoad) -> FleetLoad:
    """Print a row."""
    print(f"{run.stands:6d}{run.lost:8d}{run.cpu * 1e6:11.0f}{run.median_ms:20.1f}"
          f"{run.p99_ms:8.1f}{run.worst_ms:8.1f}{run.verdict_ms:10.0f}{run.memory_mb:8.0f}"
          f"{run.generator_cpu:13.1f}{run.load:8.1f}", flush=True)  # fmt: skip
    if run.blocks:
        print(f"       {run.blocks} vibration blocks received, {run.blocks_lost} lost", flush=True)
    return run


if __name__ == "__main__":
    main()
