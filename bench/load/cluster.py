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

"""Commands on a Dask cluster whose workers are killed at work, against the same commands here.

A scheduler and four worker processes on this machine, started by dask's own commands, for each of
``flea replay``, ``calibrate`` and ``evaluate``. Two of the workers are killed while all are at
work. What is written must be that of one process here, bit for bit; of an evaluation its results,
without date, processor time and memory.

    python bench/load/cluster.py --json cluster.json
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench")]
os.environ["PYTHONPATH"] = str(ROOT)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench_scan import recording
from summary import Figure, bench_parser, write_summary

WORKERS, KILLED = 4, 2
SECONDS = 20
NOMINAL = tuple(range(1, 7))
"""Seeds of the recordings without a fault."""
FAULTS = ("jam", "winding_short", "actuator_position_dead", "motor_failure")
OF_THE_RUN = ("cpu_s", "peak_memory_bytes", "date", "commit")
"""Fields of a result that two runs of the same code have differently."""
LIMIT_S = 600.0
FLEA = (sys.executable, "-m", "flea_diag.tools.main")


@dataclass(frozen=True)
class Command:
    """A command that shares its work, and how what it writes is read."""

    name: str
    arguments: tuple[str, ...]
    written: Callable[[Path], bytes]

    def start(self, out: Path, *more: str) -> subprocess.Popen[bytes]:
        """Run it; what it writes goes to ``out``."""
        where = [text.replace("OUT", str(out)) for text in self.arguments]
        return subprocess.Popen([*FLEA, self.name, *where, *more], stdout=subprocess.DEVNULL)


def results(out: Path) -> bytes:
    """Results of an evaluation in the order of their names."""
    rows = [json.loads(row) for row in (out / "results.jsonl").read_text().splitlines()]
    kept = [{k: v for k, v in row.items() if k not in OF_THE_RUN} for row in rows]
    return json.dumps(sorted(kept, key=lambda row: str(row.get("id"))), sort_keys=True).encode()


def recorded(folder: Path) -> tuple[list[str], list[str]]:
    """All recordings, and those without a fault."""
    nominal, faulty = [], []
    for seed in NOMINAL:
        nominal.append(str(recording(folder, SECONDS, "--seed", str(seed))))
    for fault in FAULTS:
        faulty.append(str(recording(folder, SECONDS, "--fault", fault, "--at", "12")))
    return [*nominal, *faulty], nominal


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Scheduler and workers; yields the address and the workers."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    dask = (sys.executable, "-m")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:

        def started(*command: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen([*dask, *command], **quiet)  # type: ignore[call-overload]
            stack.callback(lambda: (process.kill(), process.wait()))
            return process

        started("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
                "--no-dashboard", "--scheduler-file", str(file))  # fmt: skip
        until(file.exists, "a scheduler")
        workers = [
            started("distributed.cli.dask_worker", "--scheduler-file", str(file), "--nthreads",
                    "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
            for _ in range(WORKERS)
        ]  # fmt: skip
        yield json.loads(file.read_text())["address"], workers


def until(predicate: Callable[[], bool], what: str) -> None:
    """Wait for something."""
    deadline_s = time.monotonic() + LIMIT_S
    while not predicate():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"no {what} within {LIMIT_S:g} s")
        time.sleep(0.02)


def killed_at_work(address: str, workers: list[subprocess.Popen[bytes]]) -> int:
    """Kill two workers as soon as all have work; the number that had begun some."""
    import distributed

    with distributed.Client(address) as client:
        until(lambda: len(client.scheduler_info()["workers"]) == WORKERS, "four workers")

        def busy() -> bool:
            return all(client.processing().values()) and len(client.processing()) == WORKERS

        until(busy, "work for all workers")
        for worker in workers[:KILLED]:
            os.kill(worker.pid, signal.SIGKILL)
        until(lambda: len(client.scheduler_info()["workers"]) == WORKERS - KILLED, "loss")
    return KILLED


def compared(command: Command, folder: Path) -> tuple[bool, int]:
    """Whether the cluster writes what is written here, and how many workers it lost."""
    here, there = folder / f"{command.name}_here", folder / f"{command.name}_there"
    command.start(here, "-j", "1").wait()
    with cluster(folder) as (address, workers):
        running = command.start(there, "--dask", address)
        lost = killed_at_work(address, workers)
        status = running.wait(LIMIT_S)
        assert all(worker.poll() is None for worker in workers[KILLED:])
    print(f"{command.name}: status {status}, {lost} of {WORKERS} workers killed", flush=True)
    return command.written(here) == command.written(there), lost


def main() -> int:
    """Compare the three commands; 1 if one of them writes something else."""
    parser: argparse.ArgumentParser = bench_parser(__doc__)
    given = parser.parse_args()
    figures = []
    with tempfile.TemporaryDirectory() as name:
        folder, bags = Path(name), Path(name) / "bags"
        bags.mkdir()
        every, nominal = recorded(bags)
        read = Path.read_bytes
        commands = (
            Command("replay", (*every, "-q", "--json", "OUT"), read),
            Command("calibrate", (*nominal, "-o", "OUT"), read),
            Command("evaluate", (str(bags), "-q", "-o", "OUT"), results),
        )
        for command in commands:
            equal, lost = compared(command, folder)
            print(f"{command.name}: {'equal bit for bit' if equal else 'DIFFERENT'}", flush=True)
            count = len(nominal if command.name == "calibrate" else every)
            words = f"flea {command.name}, {lost} of {WORKERS} workers killed: equal bit for bit"
            figures.append(Figure(words, count if equal else 0, "recordings", count))
    write_summary("bench/load/cluster.py", figures, given.json)
    return 0 if all(figure.value for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
