"""Speed of a replay from the bag to the verdict on one core, relative to real time.

Simulated recordings at 100 Hz without vibration, healthy and with a jam. ``singly`` processes
record by record instead of blocks. Both are measured in turns, in CPU time.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np
from bench_scan import KINDS, pipeline, recording
from summary import Figure, bench_parser, write_summary

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
SECONDS = 120
TURNS = 3
PERIOD_S = 0.01


def in_blocks(bag: Path, kind: str, backend: str) -> tuple[float, str, int]:
    """CPU time, s, of the replay function of the command, digest, and number of scans."""
    from flea_diag.tools.replay.replay import replay

    stage = pipeline(kind, backend)
    begin = time.process_time()
    summary = replay(bag, stage)
    return time.process_time() - begin, summary["digest"], summary["scans"]


def singly(bag: Path, kind: str, backend: str) -> tuple[float, str]:
    """The same, record by record."""
    from flea_diag.stages.digest import digest
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.records import ChannelTable, Scan

    stage = pipeline(kind, backend)
    begin = time.process_time()
    said = []
    for _, record in BagReader(bag).records((ChannelTable, Scan)):
        said += stage.handle(record)
    found = digest([*said, *stage.finish()])
    return time.process_time() - begin, found


def compared(bag: Path, kind: str, backend: str) -> tuple[float, float]:
    """Speed relative to real time in blocks and singly; the digests must be equal."""
    spent, count = [], 0
    for _ in range(TURNS):
        quick, one, count = in_blocks(bag, kind, backend)
        slow, other = singly(bag, kind, backend)
        if one != other:
            raise SystemExit(f"{bag.name}, {kind}: the digests differ")
        spent.append((quick, slow))
    quick, slow = np.median(spent, axis=0)
    return count * PERIOD_S / float(quick), count * PERIOD_S / float(slow)


def main() -> None:
    """Print times real time of both recordings, with each state observer."""
    arguments, figures = bench_parser(__doc__).parse_args(), []
    with tempfile.TemporaryDirectory() as folder:
        runs = {
            "nominal": recording(Path(folder), SECONDS),
            "jam at 60 s": recording(Path(folder), SECONDS, "--fault", "jam", "--at", "60"),
        }
        print(f"{'':14s}{'state observer':20s}{'x real time':>14s}{'singly':>10s}{'ratio':>8s}")
        for name, bag in runs.items():
            for kind, backend in KINDS:
                quick, slow = compared(bag, kind, backend)
                what = f"{kind}, {backend}"
                print(f"{name:14s}{what:20s}{quick:14.0f}{slow:10.0f}{quick / slow:8.1f}")
                figures += [
                    Figure(f"{name}, {what}", quick, "x real time", TURNS, seed="21"),
                    Figure(f"{name}, {what}", quick / slow, "x", TURNS, seed="21",
                           against="the same scan by scan"),
                ]  # fmt: skip
    write_summary("replay", figures, arguments.json)


if __name__ == "__main__":
    main()
