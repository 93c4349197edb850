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

"""What the checks of outside input cost in a replay and in live scans.

    scripts/bench gates                      the checks alone, as a share of all CPU time
    scripts/bench gates --against FOLDER     and all else built since a worktree of another state

Alone: the check of messages by itself, and reading a bag with its checks and budgets less the same
without them, each the shortest of many, beside a live scan and a replay of the same build. Against
another tree: both are run in turn, in processes of their own with the same Python; the figure is
the median over the pairs of the ratio of their CPU times, each the shortest of four.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

from summary import ROOT, Figure, bench_parser, write_summary

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.bags.bag_reader import BagReader
from flea_diag.wire.bags.budget import Budget
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.messages import gate
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import ChannelTable, Scan, VibrationBlock

PAIRS = 7
SOURCES = (ChannelTable, Scan, VibrationBlock)
NOMINAL = ROOT / "bags" / "nominal"
LIVE = ROOT / "bags" / "live_motor_current_bias"
BAGS = sorted(file.parent for file in (ROOT / "bags").glob("*/metadata.yaml"))
PROGRAM = """
import contextlib, io, sys, time
from flea_diag.tools.main import main
try:
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.configuration.stand import load_stand
    pipeline_of = lambda: make_pipeline(load_stand())
except ImportError:  # before the configuration was one of stands
    from flea_diag.configuration import make_pipeline
    pipeline_of = lambda: make_pipeline(None)
try:
    from flea_diag.wire.bags.bag_reader import BagReader
    from flea_diag.wire.messages.codec import decode, encode
except ImportError:  # before the modules of wire were in packages
    from flea_diag.wire.bag_reader import BagReader
    from flea_diag.wire.codec import decode, encode

SOURCES = ("ChannelTable", "Scan", "VibrationBlock")
bag, *bags = sys.argv[1:]

def replay():
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["replay", *bags]) == 0

def live():
    pipeline = pipeline_of()
    for kind, data in messages:
        pipeline.handle(decode(kind, data))

def cpu_s(work, times=4):
    # The shortest of several: others on the machine make it longer, nothing makes it shorter.
    work()  # compile and import
    taken = []
    for _ in range(times):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return min(taken)

sources = [kind for kind in pipeline_of().consumes if kind.__name__ in SOURCES]
records = [record for _, record in BagReader(bag).records(sources)]
messages = [(type(record), encode(record)) for record in records]
print(cpu_s(replay), cpu_s(live))
"""


def measured(tree: Path) -> tuple[float, float]:
    """CPU time of a replay and of live scans with the sources of a tree, s."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(LIVE), *map(str, BAGS)],
        cwd=tree, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    replay_s, live_s = done.stdout.split()
    return float(replay_s), float(live_s)


def least_s(work: Callable[[], object], times: int) -> float:
    """CPU time of this thread, the shortest of several."""
    taken = []
    for _ in range(times):
        begin_s = time.thread_time()
        work()
        taken.append(time.thread_time() - begin_s)
    return min(taken)


def in_live_scans() -> Figure:
    """Share of the checks of messages in decoding and diagnosing them."""
    records: list[Any] = [record for _, record in BagReader(NOMINAL).records(SOURCES)]
    messages = [(type(record), encode(record)) for record in records]

    def live() -> None:
        pipeline = make_pipeline(load_stand())
        for kind, data in messages:
            pipeline.handle(decode(kind, data))

    def check(one: Callable[[Any], object]) -> float:
        return least_s(lambda: [one(record) for record in decoded], 50)

    decoded = [decode(kind, data) for kind, data in messages]
    check_s = check(gate.check) - check(id)
    share = 100.0 * check_s / least_s(live, 5)
    print(f"check of messages: {1e6 * check_s / len(records):.2f} us each")
    return Figure("checks in live scans, share of CPU time", share, "%", len(records))


def in_replays() -> Figure:
    """Share of checks and budgets of a bag in reading and diagnosing it."""

    def read() -> int:
        return sum(1 for _ in BagReader(NOMINAL).blocks(SOURCES))

    def replay() -> None:
        pipeline = make_pipeline(load_stand())
        for part in BagReader(NOMINAL).blocks(SOURCES):
            pipeline.handle_block(part) if isinstance(part, ScanBlock) else pipeline.handle(part)

    free = dict.fromkeys(("unpack", "count", "resume", "spend", "hold", "release", "keep"), _free)
    whole_s = without_s = math.inf
    for _ in range(40):
        whole_s = min(whole_s, least_s(read, 1))
        with patch.multiple(Budget, **free), patch.object(gate, "twice", lambda _: ""):
            without_s = min(without_s, least_s(read, 1))
    share = 100.0 * (whole_s - without_s) / least_s(replay, 5)
    print(f"reading a bag: {1e3 * whole_s:.2f} ms, {1e3 * without_s:.2f} ms without checks")
    return Figure("checks in replays, share of CPU time", share, "%", 40)


def _free(*_: object) -> None:
    """A charge that costs nothing."""


def against(other: Path, pairs: int) -> list[Figure]:
    """Ratios of CPU times to those of another tree."""
    ratios: list[tuple[float, ...]] = []
    for number in range(pairs):
        trees = (other, ROOT) if number % 2 else (ROOT, other)
        times = {tree: measured(tree) for tree in trees}
        ratios.append(tuple(a / b for a, b in zip(times[ROOT], times[other], strict=True)))
        load = os.getloadavg()[0]
        row = "replay {:.3f} x, live scans {:.3f} x".format(*ratios[-1])
        print(f"{row}, load {load:.1f}", flush=True)
    names = ("replay of six bags, CPU time", "live scans, CPU time")
    return [
        Figure(name, statistics.median(row), "x", len(row), min(row), max(row), against=other.name)
        for name, row in zip(names, zip(*ratios, strict=True), strict=True)
    ]


def main() -> int:
    """Measure and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="the other source tree")
    parser.add_argument("--pairs", type=int, default=PAIRS)
    arguments = parser.parse_args()
    figures = [in_live_scans(), in_replays()]
    if arguments.against is not None:
        figures += against(arguments.against.resolve(), arguments.pairs)
    for figure in figures:
        spread = "" if figure.low is None else f" ({figure.low:.3f} to {figure.high:.3f})"
        print(f"{figure.name}: {figure.value:.3f} {figure.unit}{spread}")
    write_summary("gates", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
