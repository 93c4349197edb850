"""What the checks of outside input cost: a replay and live scans, against another source tree.

    scripts/bench gates --against FOLDER     a worktree of the state to compare with (2f1ec3b)

Both trees are run in turn, in processes of their own with the same Python; the figure is the median
over the pairs of the ratio of their CPU times, each the shortest of four.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from pathlib import Path

from summary import ROOT, Figure, bench_parser, write_summary

PAIRS = 7
LIVE = ROOT / "bags" / "live_motor_current_bias"
BAGS = sorted(file.parent for file in (ROOT / "bags").glob("*/metadata.yaml"))
PROGRAM = """
import contextlib, io, sys, time
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.main import main
try:
    from flea_diag.wire.bags.bag_reader import BagReader
    from flea_diag.wire.messages.codec import decode, encode
except ImportError:  # before the modules of wire were in packages
    from flea_diag.wire.bag_reader import BagReader
    from flea_diag.wire.codec import decode, encode

bag, *bags = sys.argv[1:]

def replay():
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["replay", *bags]) == 0

def live():
    pipeline = make_pipeline(load_stand())
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

records = [record for _, record in BagReader(bag).records(make_pipeline(load_stand()).consumes)]
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


def main() -> int:
    """Measure and print."""
    parser = bench_parser(__doc__)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="the other source tree")
    parser.add_argument("--pairs", type=int, default=PAIRS)
    arguments = parser.parse_args()
    if arguments.against is None:
        print("gates: nothing to compare with: name another source tree by --against FOLDER")
        return 0
    other = arguments.against.resolve()
    ratios: list[tuple[float, ...]] = []
    for number in range(arguments.pairs):
        trees = (other, ROOT) if number % 2 else (ROOT, other)
        times = {tree: measured(tree) for tree in trees}
        ratios.append(tuple(a / b for a, b in zip(times[ROOT], times[other], strict=True)))
        load = os.getloadavg()[0]
        row = "replay {:.3f} x, live scans {:.3f} x".format(*ratios[-1])
        print(f"{row}, load {load:.1f}", flush=True)
    names = ("replay of six bags, CPU time", "live scans, CPU time")
    figures = [
        Figure(name, statistics.median(row), "x", len(row), min(row), max(row), against=other.name)
        for name, row in zip(names, zip(*ratios, strict=True), strict=True)
    ]
    for figure in figures:
        print(f"{figure.name}: {figure.value:.3f} x ({figure.low:.3f} to {figure.high:.3f})")
    write_summary("gates", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
