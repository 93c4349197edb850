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

"""Stands under a supervisor that starts again what ends, as systemd does with the shipped units.

Three simulated stands in one domain, each with its DAQ, diagnoser and recorder in a process of its
own. At random moments a random one is killed (SIGKILL) or told to end (SIGTERM); the supervisor
starts it again after RestartSec of the units. Right is: a verdict of that stand that is not stale
comes back by itself, no process is left at the end, and memory does not grow.

python bench/robustness/supervised.py --hours 0.2 --seed 1
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from configparser import RawConfigParser
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench"), str(ROOT / "test")]

from summary import Figure, bench_parser, share, write_summary
from support.live import Peer, environment, node

from flea_diag.nodes.run.children import end_with_parent
from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.wire.bus.stand_bus import StandBus
from flea_diag.wire.records import AmbiguityGroup

STANDS = ("arm_1", "arm_2", "arm_3")
NODES = ("daq", "diagnoser", "recorder")
BACK_S, BETWEEN_S, POLL_S = 60.0, (4.0, 10.0), 0.05
SETTLED_S = 60.0
"""Time after which memory is taken to be that of a stand that runs."""


def restart_s() -> float:
    """RestartSec of the shipped unit."""
    unit = RawConfigParser(strict=False)
    unit.read(ROOT / "config/supervision/flea-diag@.service", encoding="utf-8")
    return float(unit["Service"]["RestartSec"])


@dataclass
class Service:
    """One node, started again whenever it ends."""

    stand: str
    name: str
    domain: int
    folder: Path
    process: subprocess.Popen[bytes] | None = None
    due_s: float = 0.0
    starts: int = 0
    odd: list[int] = field(default_factory=list)
    """Statuses of ends that nobody asked for."""
    asked: bool = False

    def look(self) -> None:
        """Start it if it is time to."""
        now_s = time.monotonic()
        if self.process is not None and self.process.poll() is not None:
            if not self.asked:
                self.odd.append(self.process.returncode)
            self.process, self.asked = None, False
            self.due_s = now_s + restart_s()
        if self.process is None and now_s >= self.due_s:
            self.process = subprocess.Popen(
                self._command(), cwd=self.folder, env=environment(self.domain),
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                preexec_fn=end_with_parent,
            )  # fmt: skip
            self.starts += 1

    def _command(self) -> list[str]:
        given = ["-r", f"__ns:=/{self.stand}"]
        if self.name == "daq":
            given += ["-p", "duration_s:=3600.0", "-p", "wait_for:=diagnoser"]
        if self.name == "recorder":
            given += ["-p", f"directory:={self.folder}/{self.stand}_{self.starts}"]
        return node(self.name, *given)

    def end(self, number: signal.Signals) -> None:
        """Send a signal, if it runs."""
        if self.process is not None and self.process.poll() is None:
            self.asked = True
            self.process.send_signal(number)

    def memory_mb(self) -> float:
        """Resident memory; 0 while it does not run."""
        if self.process is None or self.process.poll() is not None:
            return 0.0
        pages = Path(f"/proc/{self.process.pid}/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Hall:
    """All services of the stands, and what they say."""

    def __init__(self, domain: int, folder: Path, peer: Peer) -> None:
        self.services = [Service(s, n, domain, folder) for s in STANDS for n in NODES]
        self.peer = peer
        self.fresh_s = dict.fromkeys(STANDS, 0.0)
        """Time of the latest verdict of each stand that was not stale."""
        for stand in STANDS:
            StandBus(peer.bus, stand).subscribe(
                AmbiguityGroup, lambda group, stand=stand: self._note(stand, group)
            )

    def _note(self, stand: str, group: AmbiguityGroup) -> None:
        if not group.stale:
            self.fresh_s[stand] = time.monotonic()

    def until(self, predicate: Callable[[], bool], limit_s: float) -> bool:
        """Supervise until that holds; whether it did."""
        deadline_s = time.monotonic() + limit_s
        while not predicate():
            for service in self.services:
                service.look()
            if time.monotonic() > deadline_s:
                return False
            self.peer.bus.wait_until(predicate, POLL_S)
        return True

    def fresh_since(self, stands: tuple[str, ...], since_s: float) -> bool:
        """Whether each of them has given a verdict since then."""
        return all(self.fresh_s[stand] > since_s for stand in stands)


def main() -> int:
    """Run and print; 1 where anything was not right."""
    parser = bench_parser(__doc__)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    drawn = random.Random(arguments.seed)
    back_s: list[float] = []
    lost = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        reserved_domain() as domain,
        Peer(domain) as peer,
    ):
        hall = Hall(domain, Path(folder), peer)
        begin_s = time.monotonic()
        started = hall.until(lambda: hall.fresh_since(STANDS, begin_s), 180.0)
        first_s = time.monotonic() - begin_s
        hall.until(lambda: False, SETTLED_S / 4)
        before = max(s.memory_mb() for s in hall.services if s.name == "diagnoser")
        while time.monotonic() - begin_s < 3600.0 * arguments.hours and started:
            victim = drawn.choice(hall.services)
            number = drawn.choice((signal.SIGKILL, signal.SIGTERM))
            ends_s, starts = time.monotonic(), victim.starts
            victim.end(number)
            hall.until(lambda v=victim, n=starts: v.starts > n, BACK_S)
            again_s = time.monotonic()
            stand = (victim.stand,)
            again = hall.until(lambda s=stand, t=again_s: hall.fresh_since(s, t), BACK_S)
            lost += not again
            back_s.append(time.monotonic() - ends_s)
            hall.until(lambda: False, drawn.uniform(*BETWEEN_S))
        memory = [s.memory_mb() for s in hall.services if s.name == "diagnoser"]
        pids = [s.process.pid for s in hall.services if s.process is not None]
        for service in hall.services:
            service.end(signal.SIGTERM)
        statuses = [s.process.wait(30.0) for s in hall.services if s.process is not None]
        orphans = sum(Path(f"/proc/{pid}").exists() for pid in pids)
    odd = [status for service in hall.services for status in service.odd]
    print(f"first verdicts of {len(STANDS)} stands after {first_s:.1f} s")
    last, came = max(back_s, default=0.0), len(back_s) - lost
    print(
        f"{came} of {len(back_s)} times the verdict came back, at most {last:.1f} s after the kill"
    )
    print(f"ends that nobody asked for: {odd or 'none'}; statuses at the end {set(statuses)}")
    print(f"diagnosers: {before:.0f} MB at the start, {max(memory):.0f} MB at the end")
    print(f"orphans: {orphans}")
    seed = str(arguments.seed)
    write_summary(
        "bench/robustness/supervised.py",
        [
            share("verdict back by itself", came, len(back_s), seed=seed),
            Figure("verdict back, at most", last, "s", len(back_s), seed=seed),
            Figure("memory of a diagnoser, end over start", max(memory) / before, "1", len(memory)),
            Figure("orphans", orphans, "processes"),
        ],
        arguments.json,
    )
    return 0 if started and not (lost or odd or orphans or any(statuses)) else 1


if __name__ == "__main__":
    sys.exit(main())
