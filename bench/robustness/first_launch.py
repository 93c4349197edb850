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

"""The first launch after an installation: nothing is compiled, and the machine is busy.

Stand and replay in turn, each through its launch file with a compile cache of its own that is empty
at first, beside processes that keep the cores busy. Right is: status 0, no orphan, no traceback;
for the stand the true fault in a group of at most three; for a replay the digest of `flea replay`.
``ros2 launch`` is not on PyPI: the stand-in of the tests runs the launch files.

scripts/first_launch                     20 runs beside two busy processes
scripts/first_launch --runs 2 --json FILE
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench"), str(ROOT / "test")]

from summary import Figure, bench_parser, share, write_summary
from support.decisions import BAGS, NAMES
from support.live import Peer, Process, children
from support.prefix import launched, source_prefix

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.run_summary import summarise
from flea_diag.stages.digest import DECISIONS, digest
from flea_diag.tools.main import main as flea
from flea_diag.tools.replay.recorded import completed
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import AmbiguityGroup, Detection, Hypotheses, Record, Scan, Truth

FAULTS = ("jam", "motor_current_bias", "winding_short", "motor_temperature_bias", "nominal")
ONSET_S, DURATION_S = 8.0, 30.0
LIMIT_S = 600.0
JUDGED = (Scan, Truth, Detection, AmbiguityGroup)


@dataclass(frozen=True)
class FirstLaunch:
    """One launch; ``first_verdict_s`` and ``took_s`` count from its start."""

    kind: str
    what: str
    status: int
    first_verdict_s: float
    took_s: float
    load: float
    faults: tuple[str, ...]

    @property
    def right(self) -> bool:
        """Whether nothing is to be said against it."""
        return not self.faults


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Processes that never wait."""
    workers = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()


def launch(kind: str, what: str, expected: str, folder: Path) -> FirstLaunch:
    """Launch once, wait for the end, and judge."""
    bag = folder / "bag"
    arguments = {
        "stand": [*_fault(what), f"duration_s:={DURATION_S}", f"bag:={bag}"],
        "replay": [f"bag:={BAGS / what}"],
    }[kind]
    more = {
        "AMENT_PREFIX_PATH": source_prefix(folder / "prefix"),
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "XDG_STATE_HOME": str(folder / "state"),
        "ROS_LOG_DIR": str(folder / "log"),
    }
    heard: list[Record] = []
    began_s = time.monotonic()
    verdict_s = float("nan")
    with reserved_domain() as domain, Peer(domain) as peer:
        for record_type in (*DECISIONS, Hypotheses):
            peer.bus.subscribe(record_type, heard.append)
        with Process(launched(f"{kind}.launch.py", *arguments), domain, **more) as process:
            if peer.bus.wait_until(lambda: _ended(process) or _verdict(heard), LIMIT_S):
                verdict_s = time.monotonic() - began_s
            started: set[int] = set()
            while not peer.bus.wait_until(lambda: _ended(process), 1.0):
                started |= set(children(process.child.pid))
                if time.monotonic() - began_s > LIMIT_S:
                    process.child.kill()
            status = process.end()
            orphans = [pid for pid in started if Path(f"/proc/{pid}").exists()]
    faults = [f"status {status}"] if status else []
    faults += [f"{len(orphans)} orphans"] if orphans else []
    faults += ["traceback"] if "Traceback" in process.output else []
    faults += _judged(bag) if kind == "stand" else _differs(heard, expected)
    if faults:
        (folder.parent / f"{folder.name}.log").write_text(process.output, encoding="utf-8")
    took_s, load = time.monotonic() - began_s, os.getloadavg()[0]
    return FirstLaunch(kind, what, status, verdict_s, took_s, load, tuple(faults))


def _fault(name: str) -> list[str]:
    return [] if name == "nominal" else [f"fault:={name}", f"fault_onset_s:={ONSET_S}"]


def _ended(process: Process) -> bool:
    process.read()  # a full pipe would stop it
    return process.child.poll() is not None


def _verdict(heard: list[Record]) -> bool:
    return any(isinstance(record, AmbiguityGroup) for record in heard)


def _judged(bag: Path) -> list[str]:
    """What `scripts/run` says against the recorded run."""
    if not bag.is_dir():
        return ["no bag"]
    return list(summarise(record for _, record in read_bag(bag, JUDGED)).failures)


def _differs(heard: list[Record], expected: str) -> list[str]:
    found = digest(completed(heard))
    return [] if found == expected else [f"digest {found[:12]}, not {expected[:12]}"]


def digests(folder: Path) -> dict[str, str]:
    """Digest of `flea replay` of each bag that comes with the source."""
    bags = [str(BAGS / name) for name in NAMES]
    flea(["replay", *bags, "-q", "--json", f"{folder}/"])
    return {
        name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))["digest"]
        for name in NAMES
    }


def main() -> int:
    """Run and print; exit status 1 where one was not right."""
    parser = bench_parser(__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--busy", type=int, default=2, help="busy processes beside (2)")
    parser.add_argument("--until", metavar="HH:MM", help="begin no run after this time of the day")
    given = parser.parse_args()
    launches: list[FirstLaunch] = []
    with tempfile.TemporaryDirectory() as name:
        expected = digests(Path(name))
        with busy(given.busy):
            for number in range(given.runs):
                if given.until and time.strftime("%H:%M") >= given.until:
                    break
                kind, names = (("stand", FAULTS), ("replay", NAMES))[number % 2]
                what = names[number // 2 % len(names)]
                folder = Path(name) / str(number)
                folder.mkdir()
                launches.append(launch(kind, what, expected.get(what, ""), folder))
                _print(launches[-1], folder)
    right = sum(one.right for one in launches)
    print(f"{right} of {len(launches)} launches right", file=sys.stderr)
    write_summary("scripts/first_launch", figures(launches), given.json)
    return 0 if launches and all(one.right for one in launches) else 1


def _print(one: FirstLaunch, folder: Path) -> None:
    said = "right" if one.right else ", ".join(one.faults)
    print(
        f"{one.kind:6} {one.what:24} first verdict {one.first_verdict_s:6.1f} s, "
        f"ended {one.took_s:6.1f} s, load {one.load:4.1f}: {said}",
        file=sys.stderr,
        flush=True,
    )
    log = folder.parent / f"{folder.name}.log"
    if log.exists():
        print(log.read_text(encoding="utf-8"), file=sys.stderr)


def figures(launches: list[FirstLaunch]) -> Iterator[Figure]:
    """How many were right, and when each kind said its first verdict."""
    for kind in dict.fromkeys(one.kind for one in launches):
        own = [one for one in launches if one.kind == kind]
        yield share(f"{kind}: right", sum(one.right for one in own), len(own))
        times = [one.first_verdict_s for one in own if math.isfinite(one.first_verdict_s)]
        if times:
            yield Figure(f"{kind}: first verdict after", statistics.median(times), "s", len(times),
                         min(times), max(times))  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
