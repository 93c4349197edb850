"""Stands that one process of the fleet carries: scans lost, latency, CPU and memory.

A process of its own publishes prepared scans at 100 Hz to each stand; its load is stated apart. A
third one, this, hears residuals and verdicts. One stand in eight jams half way. Latency is from the
stamp of a scan, the time at which it is due, to the arrival of its residual.

    scripts/bench fleet                                  1 to 32 stands, 30 s each
    python bench/bench_fleet.py --seconds 600 --stands 32 --batch-ms 50 --processes 2
"""

from __future__ import annotations

import os
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
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
from summary import Figure, bench_parser, write_summary
from support.live import Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.live_run import discovery
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health, Scan

PERIOD_S = 0.01
JAMMED = 8
"""One stand in so many jams."""
STAMP = struct.Struct("<iI")
STAMP_AT = 4
READY = "publishers are connected"
LATEST_MS = 200.0


def names(count: int) -> list[str]:
    """Namespaces of the stands."""
    return [f"bay_{number}" for number in range(count)]


def messages(bag: Path) -> list[bytearray]:
    """The scans of a recording, encoded."""
    return [bytearray(codec.encode(scan)) for _, scan in BagReader(bag).records((Scan,))]


def generate(count: int, folder: Path, seconds: float) -> None:
    """Publish prepared scans, stamped with the time at which each is due; the load generator."""
    import rclpy
    from sensor_msgs.msg import JointState

    sound, jammed = (messages(folder / name) for name in ("sound", "jammed"))
    rclpy.init()
    me = rclpy.create_node("generator")
    out = [
        (me.create_publisher(JointState, f"/{name}/sensors/slow", 100), rows)
        for number, name in enumerate(names(count))
        for rows in [jammed if number % JAMMED == 0 else sound]
    ]
    while not all(publisher.get_subscription_count() for publisher, _ in out):
        time.sleep(0.05)
    time.sleep(1.0)  # a writer knows its reader before the reader knows the writer
    print(READY, flush=True)
    begin, begin_ns = time.monotonic(), time.time_ns()
    for number in range(round(seconds / PERIOD_S)):
        time.sleep(max(0.0, begin + number * PERIOD_S - time.monotonic()))
        stamp = divmod(begin_ns + round(1e9 * number * PERIOD_S), 1_000_000_000)
        for publisher, rows in out:
            STAMP.pack_into(rows[number], STAMP_AT, *stamp)
            publisher.publish(bytes(rows[number]))
    print("all published", flush=True)
    rclpy.spin(me)  # what is not acknowledged yet is sent again, until this process is ended


@dataclass
class Heard:
    """What the stands have said."""

    residuals: Counter[str] = field(default_factory=Counter)
    latencies_ms: list[float] = field(default_factory=list)
    verdicts_ms: list[float] = field(default_factory=list)
    running: dict[str, str] = field(default_factory=dict)
    stamps: dict[str, bytes] = field(default_factory=dict)

    def join(self, me: Any, count: int) -> None:
        """Subscribe to residuals, verdicts and health."""
        from diagnostic_msgs.msg import DiagnosticArray
        from sensor_msgs.msg import JointState

        def health(data: bytes) -> None:
            record = codec.decode(Health, data)
            self.running[record.node] = record.message

        me.create_subscription(DiagnosticArray, "/diagnostics", health, 1000, raw=True)
        for name in names(count):

            def residual(data: bytes, name: str = name) -> None:
                self.residuals[name] += 1
                self.latencies_ms.append(age_ms(data))

            def verdict(data: bytes, name: str = name) -> None:
                stamp = data[STAMP_AT : STAMP_AT + STAMP.size]
                if self.stamps.get(name) != stamp:  # a repeated one is as old as its evidence
                    self.stamps[name] = stamp
                    self.verdicts_ms.append(age_ms(data))

            me.create_subscription(JointState, f"/{name}/residual", residual, 1000, raw=True)
            group = f"/{name}/ambiguity_group"
            me.create_subscription(DiagnosticArray, group, verdict, 100, raw=True)


@contextmanager
def listener(domain: int, heard: Heard, count: int) -> Iterator[Callable[..., None]]:
    """Join the domain; yields a function that listens until a predicate holds."""
    import rclpy
    from rclpy.experimental import EventsExecutor

    os.environ.update(discovery())
    context = rclpy.Context()
    context.init(domain_id=domain)
    me = rclpy.create_node("listener", context=context)
    heard.join(me, count)
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


def measured(count: int, folder: Path, seconds: float, batch_ms: int, processes: int) -> FleetLoad:
    """Run a fleet of so many stands, spread over so many processes."""
    parts = [names(count)[k::processes] for k in range(min(processes, count))]
    given = ("-p", f"batch_ms:={batch_ms}", "-p", "memory:=none")
    scans = round(seconds / PERIOD_S)
    with ExitStack() as stack:
        domain = stack.enter_context(reserved_domain())
        fleets = [
            stack.enter_context(Process(node("flea_diag.nodes.fleet.fleet", "-r",
                f"__node:=fleet_{k}", "-p", f"stands:={part}", *given), domain))
            for k, part in enumerate(parts)
        ]  # fmt: skip
        heard = Heard()
        until = stack.enter_context(listener(domain, heard, count))
        ready = {f"fleet_{k}": f"{len(part)} of {len(part)}" for k, part in enumerate(parts)}
        until(lambda: all(heard.running.get(n, "").startswith(w) for n, w in ready.items()), 120.0)
        command = [sys.executable, __file__, "--generate", str(count), "--folder", str(folder)]
        generator = stack.enter_context(Process([*command, "--seconds", str(seconds)], domain))
        generator.wait_for(READY)
        heard.latencies_ms.clear()
        pids = [fleet.child.pid for fleet in fleets]
        began = sum(map(cpu_s, pids)), cpu_s(generator.child.pid)
        ends = time.monotonic() + seconds + 2.0
        until(lambda: time.monotonic() > ends, seconds + 3.0)
        spent = sum(map(cpu_s, pids)) - began[0], cpu_s(generator.child.pid) - began[1]
        memory = sum(map(resident_mb, pids))
    late = np.asarray(heard.latencies_ms or [np.nan])
    return FleetLoad(
        count,
        count * scans - sum(heard.residuals.values()),
        spent[0] / (count * scans),
        100.0 * spent[1] / seconds,
        memory,
        *(float(np.percentile(late, share)) for share in (50, 99, 100)),
        max(heard.verdicts_ms, default=np.nan),
    )


def figures(runs: list[FleetLoad], seconds: float, batch_ms: int, processes: int) -> list[Figure]:
    """The rows to keep."""
    told = f"batch_ms {batch_ms}, {processes} process{'es' if processes > 1 else ''}"
    rows = []
    for run in runs:
        n, where = round(run.stands * seconds / PERIOD_S), f"{run.stands} stands, {told}"
        rows += [
            Figure(f"{where}: scans lost", run.lost, "scans", n),
            Figure(f"{where}: CPU a scan", run.cpu * 1e6, "us", n),
            Figure(f"{where}: latency, 99 %", run.p99_ms, "ms", n, run.median_ms, run.worst_ms),
            Figure(f"{where}: resident memory", run.memory_mb, "MB"),
            Figure(f"{where}: load generator", run.generator_cpu, "% of a core"),
        ]
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
    parser.add_argument("--generate", type=int, help="be the load generator of so many stands")
    parser.add_argument("--folder", type=Path, help="recordings of the load generator")
    given = parser.parse_args()
    if given.generate:
        generate(given.generate, given.folder, given.seconds)
        return
    runs = []
    with tempfile.TemporaryDirectory() as name:
        folder, length = Path(name), round(given.seconds) + 2
        half = str(given.seconds / 2)
        recording(folder, length).rename(folder / "sound")
        recording(folder, length, "--fault", "jam", "--at", half).rename(folder / "jammed")
        print("stands    lost  us a scan  latency ms: median    99 %   worst   verdict      MB"
              "  generator %    load")  # fmt: skip
        for count in given.stands:
            run = measured(count, folder, given.seconds, given.batch_ms, given.processes)
            runs.append(run)
            print(f"{count:6d}{run.lost:8d}{run.cpu * 1e6:11.0f}{run.median_ms:20.1f}"
                  f"{run.p99_ms:8.1f}{run.worst_ms:8.1f}{run.verdict_ms:10.0f}{run.memory_mb:8.0f}"
                  f"{run.generator_cpu:13.1f}{os.getloadavg()[0]:8.1f}", flush=True)  # fmt: skip
    kept = figures(runs, given.seconds, given.batch_ms, given.processes)
    write_summary("fleet", kept, given.json)


if __name__ == "__main__":
    main()
