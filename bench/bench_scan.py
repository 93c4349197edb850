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

"""CPU time of one scan through observer, detection and isolation, and memory over a long run.

The simulated stand is healthy and in motion, without vibration. Scans are processed one by one, as
live, and in blocks, as in a replay, in turns, so that other load on the machine affects both
equally. For the memory the recording is repeated in blocks, after a gap each time: ``--scans``
scans, by default a tenth of a day at 100 Hz.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from summary import Figure, bench_parser, write_summary

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
DAY_SCANS = 8_640_000
BLOCK = 1000
SECONDS = 60
SETTLE = 1000
KINDS = (
    *((("none", "numba"), ("particle", "numba")) if find_spec("numba") else ()),
    ("none", "numpy"),
    ("kalman", "numpy"),
    ("particle", "numpy"),
)


def recording(folder: Path, seconds: int = SECONDS, *more: str, vibration: bool = False) -> Path:
    """Simulate a run into a bag, by default without vibration."""
    bag = folder / f"run{seconds}{''.join(more)}"
    command = [sys.executable, "-m", "flea_diag.tools.main", "simulate", "nominal"]
    command += [] if vibration else ["--no-vibration"]
    options = ["--seed", "21", "--duration", str(seconds), "-o", str(bag), *more]
    subprocess.run([*command, *options], check=True, stdout=subprocess.DEVNULL)
    return bag


def pipeline(kind: str, backend: str):
    """The three stages, with this state observer."""
    from flea_diag.configuration.component import DIAGNOSER

    parameters = DIAGNOSER.parameters(
        state_observer=kind, observer_backend=backend, source="replay"
    )
    return DIAGNOSER.build(parameters)


def costs(bag: Path, kind: str, backend: str) -> tuple[float, float]:
    """CPU time, s, per scan, singly and in blocks: medians over pieces of ``BLOCK`` scans."""
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import ChannelTable, Scan

    read = list(BagReader(bag).blocks((ChannelTable, Scan)))
    blocks = [record for record in read if isinstance(record, ScanBlock)]
    one, many = pipeline(kind, backend), pipeline(kind, backend)
    for stage in (one, many):
        stage.handle(next(record for record in read if isinstance(record, ChannelTable)))
    spent: list[tuple[float, float]] = []
    for block in blocks:
        scans = list(block.records())
        begin = time.process_time()
        for scan in scans:
            one.handle(scan)
        middle = time.process_time()
        many.handle_block(block)
        spent.append(((middle - begin) / len(block), (time.process_time() - middle) / len(block)))
    singly, in_blocks = np.median(spent[1:], axis=0)
    return float(singly), float(in_blocks)


def memory(bag: Path, scans: int) -> list[tuple[int, float]]:
    """Number of scans and resident memory, MB, at ten points of the run."""
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.blocks import ScanBlock
    from flea_diag.wire.records import Scan

    blocks = [b for b in BagReader(bag).blocks((Scan,)) if isinstance(b, ScanBlock)]
    length_ns = int(blocks[-1].stamps_ns[-1] - blocks[0].stamps_ns[0]) + 1_000_000_000
    stage, fed, seen = pipeline("none", "numpy"), 0, []
    while fed < scans:
        for block in blocks:
            stage.handle_block(block)
            fed += len(block)
        blocks = [
            ScanBlock(block.stamps_ns + length_ns, block.channels, block.values) for block in blocks
        ]
        if fed >= scans * (len(seen) + 1) / 10:
            seen.append((fed, resident_mb()))
    return seen


def resident_mb() -> float:
    """Resident memory, MB; the peak where the system gives no current value."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Print cost and memory."""
    parser = bench_parser(__doc__)
    parser.add_argument("--scans", type=int, default=DAY_SCANS // 10)
    arguments, figures = parser.parse_args(), []
    with tempfile.TemporaryDirectory() as folder:
        bag = recording(Path(folder))
        print(f"{'state observer':20s}{'us a scan, live':>18s}{'in blocks':>12s}{'ratio':>8s}")
        for kind, backend in KINDS:
            singly, in_blocks = costs(bag, kind, backend)
            ratio = singly / in_blocks
            name = f"{kind}, {backend}"
            print(f"{name:20s}{singly * 1e6:18.1f}{in_blocks * 1e6:12.1f}{ratio:8.1f}")
            pieces = SECONDS * 100 // BLOCK - 1
            figures += [
                Figure(f"one scan, {name}", singly * 1e6, "us", pieces, seed="21"),
                Figure(f"one scan, {name}", ratio, "x", pieces, seed="21",
                       against="the same in blocks"),
            ]  # fmt: skip
        print(f"\nresident memory over {arguments.scans} scans (a day has {DAY_SCANS})")
        seen = memory(bag, arguments.scans)
        for fed, size in seen:
            print(f"{fed:10d} scans {size:8.1f} MB")
    sizes = [size for _, size in seen]
    figures.append(
        Figure(f"resident memory over {arguments.scans} scans", sizes[-1], "MB", len(sizes),
               min(sizes), max(sizes), seed="21")
    )  # fmt: skip
    write_summary("scan", figures, arguments.json)


if __name__ == "__main__":
    main()
