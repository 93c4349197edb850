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

"""kill -9 of each process of live runs in turn, at random moments: losses and recovery times.

Each run is `scripts/run` with one fault; its nodes are killed in random order, one after the other,
each after the previous one has recovered, and the stand last. Checked: recording lost, bags open
unrepaired, time until the verdict is back, and no wrong verdict at any time.

scripts/kill                          20 runs
scripts/kill --composed               the same with the diagnosis in one process
scripts/kill --runs 1 --json -        one run, result as JSON
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from support.live import Peer, Process, process_of

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.nodes.run.live_run import COMPOSED, SEPARATE
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import AmbiguityGroup, Outcome, Scan, Truth

FAULTS = ("jam", "motor_current_bias", "motor_temperature_bias", "winding_short", "nominal")
ONSET_S = (5.0, 25.0)
PAUSE_S = (0.5, 6.0)
"""Time from the recovery of one node to the next kill."""
LIMIT_S = 120.0
"""Timeout of all waits, sufficient for a busy machine."""
MOST_LOST_S, MOST_BACK_S = 1.0, 1.5
QUIET = (Outcome.NOMINAL, Outcome.NOT_OBSERVABLE)
BLIND = "watched from"
"""Text of a verdict that does not cover the time before."""


@dataclass
class Kill:
    """One process killed; times in seconds, NaN where not applicable to the node.

    ``away_s``: from the kill until the node is in the graph again. ``verdict_s``: from then until
    a verdict that is not stale. ``lost_s``: data sent before the kill that are in no bag.
    """

    run: int
    node: str
    after_onset_s: float
    away_s: float = float("nan")
    verdict_s: float = float("nan")
    lost_s: float = float("nan")


@dataclass
class Result:
    """Results of all runs so far."""

    kills: list[Kill] = field(default_factory=list)
    bags: int = 0
    unreadable: list[str] = field(default_factory=list)
    verdicts: int = 0
    blind: int = 0
    """Healthy verdicts on a fault already present at the restart, which say so."""
    wrong: list[str] = field(default_factory=list)

    def failures(self) -> list[str]:
        """Descriptions of all failed checks."""
        words = [f"bag does not open: {each}" for each in self.unreadable]
        words += [f"wrong verdict: {each}" for each in self.wrong]
        for kill in self.kills:
            where = f"run {kill.run}, {kill.node}"
            if kill.lost_s > MOST_LOST_S:
                words.append(f"{where}: {kill.lost_s:.2f} s of recording lost")
            if kill.verdict_s > MOST_BACK_S:
                words.append(f"{where}: verdict back after {kill.verdict_s:.2f} s")
        return words


class Campaign:
    """Runs one after the other; only processes of these runs are killed."""

    def __init__(self, seed: int, folder: Path, options: list[str]) -> None:
        self._random = random.Random(seed)
        self._folder = folder
        self._nodes = (*(COMPOSED if "--composed" in options else SEPARATE), "console")
        self._options = options
        self.result = Result()

    def run(self, number: int) -> None:
        """One live run in which each node is killed once."""
        fault, onset_s = FAULTS[number % len(FAULTS)], self._random.uniform(*ONSET_S)
        bag = self._folder / f"run_{number}"
        arguments = ["--fault", fault, "--at", f"{onset_s:.2f}", "--for", "1200"]
        run = [
            sys.executable,
            "-m",
            "flea_diag.nodes.run.live_run",
            "--headless",
            "--bag",
            str(bag),
        ]
        command = [*run, *self._options, *arguments, "--seed", str(1000 + number)]
        with reserved_domain() as domain, Peer(domain) as peer:
            peer.bus.subscribe(AmbiguityGroup, peer.records.append)
            peer.bus.subscribe(Truth, peer.records.append)
            with Process(command, domain) as process:
                process.wait_for("the stand starts", LIMIT_S)
                peer.find(lambda r: isinstance(r, AmbiguityGroup), LIMIT_S)
                start_s = time.time()
                order = [*self._random.sample(self._nodes, len(self._nodes)), "daq"]
                kills = [Kill(number, name, 0.0) for name in order]
                stamps = [self._kill(kill, start_s + onset_s, peer, process) for kill in kills]
                process.child.wait(LIMIT_S)
        self.result.kills += kills
        self._judge(number, fault, peer.records)
        self._read(bag, kills, stamps)

    def _kill(self, kill: Kill, onset_s: float, peer: Peer, process: Process) -> int:
        """Kill one node and wait for recovery; return the stamp of the newest scan at the kill."""
        pause_s = self._random.uniform(*PAUSE_S)
        peer.bus.wait_until(lambda: False, pause_s)
        before = _endpoints(peer, kill.node)
        os.kill(process_of(process.child.pid, kill.node), signal.SIGKILL)
        killed_s, killed_ns = time.monotonic(), time.time_ns()
        kill.after_onset_s = killed_ns / 1e9 - onset_s
        if kill.node == "daq":
            return killed_ns
        peer.until(lambda: bool(_endpoints(peer, kill.node) - before), LIMIT_S)
        back_s, seen = time.monotonic(), len(peer.records)
        kill.away_s = back_s - killed_s
        heard = peer.bus.wait_until(lambda: any(map(_is_current, peer.records[seen:])), LIMIT_S)
        kill.verdict_s = time.monotonic() - back_s if heard else math.inf
        process.read()
        return killed_ns

    def _judge(self, number: int, fault: str, records: Iterable[object]) -> None:
        """Compare every verdict with the truth, before, during and after each recovery."""
        truth, found = "", False
        for record in records:
            if isinstance(record, Truth) and record.fault not in ("", "nominal"):
                truth = record.fault
            if not isinstance(record, AmbiguityGroup):
                continue
            self.result.verdicts += 1
            names = [member.fault for member in record.members]
            if found and record.outcome in QUIET and BLIND in record.words:
                self.result.blind += 1
                continue
            if not truth:
                right = record.outcome in QUIET
            elif names:
                right, found = truth in names, True
            else:
                right = record.outcome in QUIET and not found
            if not right:
                self.result.wrong.append(
                    f"run {number}, {fault}: {record.outcome.value} {', '.join(names)} "
                    f"({record.words[:80]})"
                )

    def _read(self, first: Path, kills: list[Kill], killed_ns: list[int]) -> None:
        """Open the bags unrepaired; determine what a killed recorder had not written."""
        bags = sorted(first.parent.glob(f"{first.name}*/metadata.yaml"), key=_begun)
        newest = []
        for metadata in bags:
            self.result.bags += 1
            try:
                newest.append(_last_scan(metadata.parent))
            except Exception as error:  # any error while reading a bag is a failure
                self.result.unreadable.append(f"{metadata.parent.name}: {error}")
        recorders = [
            (k, at) for k, at in zip(kills, killed_ns, strict=True) if k.node == "recorder"
        ]
        for (kill, at_ns), last_ns in zip(recorders, newest, strict=False):
            kill.lost_s = max(at_ns - last_ns, 0) / 1e9


def _last_scan(bag: Path) -> int:
    """Stamp of the newest scan of a bag, read with another library too."""
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        assert sum(1 for _ in reader.messages()) > 0
    return max(record.stamp_ns for _, record in read_bag(bag, (Scan,)))


def _begun(metadata: Path) -> float:
    return metadata.parent.stat().st_ctime


def _is_current(record: object) -> bool:
    return isinstance(record, AmbiguityGroup) and not record.stale


def _endpoints(peer: Peer, name: str) -> set[bytes]:
    """Endpoint ids of a node; those of a killed node stay in the graph for a while."""
    node = peer.node
    infos = node.get_publishers_info_by_topic("/diagnostics")
    infos += node.get_subscriptions_info_by_topic("/ambiguity_group")
    return {bytes(info.endpoint_gid) for info in infos if info.node_name == name}


def _told(result: Result) -> str:
    """Table of recovery times and losses by process."""
    rows = [f"{'node':10} {'n':>3} {'away s':>14} {'verdict back s':>16} {'lost s':>14}"]
    for name in dict.fromkeys(kill.node for kill in result.kills):
        kills = [kill for kill in result.kills if kill.node == name]
        cells = [
            _range([getattr(k, what) for k in kills]) for what in ("away_s", "verdict_s", "lost_s")
        ]
        rows.append(f"{name:10} {len(kills):3} {cells[0]:>14} {cells[1]:>16} {cells[2]:>14}")
    rows.append(
        f"{result.bags} bags, {len(result.unreadable)} unreadable; {result.verdicts} verdicts, "
        f"{len(result.wrong)} wrong, {result.blind} blind to what was before, and said so"
    )
    return "\n".join(rows + result.failures())


def _range(values: list[float]) -> str:
    """Median and maximum, without NaN."""
    known = [value for value in values if value == value]
    return f"{median(known):.2f} / {max(known):.2f}" if known else "-"


def main() -> int:
    """Run and print; exit status 1 if any check failed."""
    parser = argparse.ArgumentParser(
        prog="scripts/kill",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--runs", type=int, default=20, help="number of runs (20)")
    parser.add_argument("--composed", action="store_true", help="the diagnosis in one process")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--json", metavar="FILE", help="write results as JSON each run; - for stdout"
    )
    parser.add_argument("--keep", metavar="DIR", help="folder for bags and logs of the runs")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="flea_kill_") as passing:
        folder = given.keep or passing
        options = ["--composed"] if given.composed else []
        campaign = Campaign(given.seed, Path(folder), options)
        for number in range(given.runs):
            campaign.run(number)
            print(
                f"run {number + 1} of {given.runs}",
                _told(campaign.result),
                sep="\n",
                file=sys.stderr,
            )
            text = json.dumps(asdict(campaign.result) | {"failures": campaign.result.failures()})
            if given.json not in (None, "-"):
                Path(given.json).write_text(text + "\n", encoding="utf-8")
    if given.json == "-":
        print(text)
    return int(bool(campaign.result.failures()))


if __name__ == "__main__":
    sys.exit(main())
