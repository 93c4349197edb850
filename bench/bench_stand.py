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

"""CPU time and jitter of the simulated stand: 30 s into a bag without ROS, and its DAQ live.

Into a bag: CPU time on one core, median of ``REPEATS``, compiled by numba and in plain Python.
Live: jitter of the scans as reported by the DAQ, and CPU time of its process. Other load on the
machine increases the jitter: use an idle machine, or real-time priority for the DAQ (``--fifo``,
needs root and chrt).

    scripts/bench stand                          all
    python bench/bench_stand.py --live --fifo    live alone, with real-time priority
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

from summary import Figure, bench_parser, write_summary
from support.live import Peer, Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.tools.stand.simulate import write_bag
from flea_diag.wire.records import Health, Scan
from flea_sim_driver.plant.plant import integrator
from flea_sim_driver.scenario.library import find_scenario
from flea_sim_driver.scenario.scenario import Scenario

RUN_S = 30.0
REPEATS = 5
LIVE_S = 30.0
LIMITS_S = {False: 0.3, True: 3.0}


def nominal(duration_s: float, *, vibration: bool) -> Scenario:
    """The nominal scenario with this duration, with or without accelerometers."""
    scenario = find_scenario("nominal")
    return replace(
        scenario,
        run=replace(scenario.run, duration_s=duration_s),
        sensors=replace(scenario.sensors, vibration=vibration),
    )


def into_a_bag(*, vibration: bool) -> float:
    """CPU time of one run into a bag, s."""
    scenario = nominal(RUN_S, vibration=vibration)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        write_bag(scenario, Path(folder) / "bag")
        return time.process_time() - begin


def bags() -> list[Figure]:
    """Print what bags cost with this backend."""
    figures = []
    with tempfile.TemporaryDirectory() as folder:  # compile and import before the clock runs
        write_bag(nominal(1.0, vibration=True), Path(folder) / "bag")
    backend = "numba" if hasattr(integrator(), "py_func") else "plain Python"
    for vibration, limit_s in LIMITS_S.items():
        times = [into_a_bag(vibration=vibration) for _ in range(REPEATS)]
        took = median(times)
        what = "scans and 2 x 3 axes of 20 kHz" if vibration else "scans alone"
        print(
            f"{backend:12} {RUN_S:.0f} s of {what:30} {took:6.3f} s of one core (limit {limit_s} s)"
        )
        name = f"{RUN_S:.0f} s of {what} into a bag, {backend}"
        figures.append(Figure(name, took, "s of CPU", REPEATS, min(times), max(times)))
    return figures


def live(fifo: bool) -> list[Figure]:
    """Print how the DAQ keeps its pace, and what that costs."""
    command = node("daq", "-p", f"duration_s:={LIVE_S}",
                   "-p", "wait_for_subscribers:=1")  # fmt: skip
    if fifo:
        command = ["chrt", "--fifo", "20", *command]
    with reserved_domain() as domain, Peer(domain) as peer:
        peer.bus.subscribe(Scan, peer.records.append)
        peer.bus.subscribe(Health, peer.records.append)
        with Process(command, domain) as daq:
            peer.until(lambda: any(isinstance(r, Scan) for r in peer.records))
            started = time.monotonic()
            begin = cpu_s(daq.child.pid)
            ends = started + LIVE_S - 1.0
            peer.bus.wait_until(lambda: time.monotonic() > ends, LIVE_S)
            spent, took = cpu_s(daq.child.pid) - begin, time.monotonic() - started
    told = [dict(r.values) for r in peer.records if isinstance(r, Health)]
    scans = sum(isinstance(r, Scan) for r in peer.records)
    print(
        f"live         {scans / took:6.1f} scans/s, jitter p99 {told[-1]['jitter_p99_ms']} ms "
        f"(limit 2 ms), {100.0 * spent / took:.1f} % of one core (limit 15 %)"
    )
    priority = "real-time priority" if fifo else "usual priority"
    return [
        Figure(f"DAQ live, 99 % of the scans within, {priority}",
               float(told[-1]["jitter_p99_ms"]), "ms", scans),
        Figure(f"DAQ live, CPU, {priority}", 100.0 * spent / took, "% of a core"),
    ]  # fmt: skip


def cpu_s(pid: int) -> float:
    """Processor time of a running process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def bags_with(disabled: str) -> list[Figure]:
    """``bags`` in a process of its own, compiled or not."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bags.json"
        command = [sys.executable, __file__, "--bags", "--json", str(path)]
        subprocess.run(command, check=True, env=environment)
        return [Figure(**row) for row in json.loads(path.read_text(encoding="utf-8"))["figures"]]


def main() -> None:
    """Measure what the command line asks for."""
    parser = bench_parser(__doc__)
    parser.add_argument("--bags", action="store_true", help="bags alone, with this backend")
    parser.add_argument("--live", action="store_true", help="the live DAQ alone")
    parser.add_argument("--fifo", action="store_true", help="real-time priority for the live DAQ")
    arguments = parser.parse_args()
    figures = []
    if arguments.bags:
        figures += bags()
    elif not arguments.live:
        figures += bags_with("0") + bags_with("1")
    if not arguments.bags:
        figures += live(arguments.fifo)
    write_summary("stand", figures, arguments.json)


if __name__ == "__main__":
    main()
