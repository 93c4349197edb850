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

"""Healthy runs recorded on disks that become full at random moments, or are read-only.

    scripts/bench disk          50 disks of each kind; needs the right to mount
    python bench/bench_disk.py 5

Checked on a full disk: one clear error, a bag that opens unrepaired, also with another library, the
data lost, and false alarms in its replay. On a read-only disk: one clear error, no files left.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

import numpy as np
from rosbags.highlevel import AnyReader
from summary import Figure, bench_parser, share, write_summary
from support import lossy

from flea_diag.errors import RecordingError
from flea_diag.nodes.recording.recorder import WHOLE_EVERY_S
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.records import Record, Scan

FIRST_SEED = 5000
RUNS = 5
"""Number of healthy runs, one unit each, recorded in turn."""
SIZES_KB = (300, 6000)
"""Disk sizes, kB, below the size of a run of 20 s."""


@dataclass(frozen=True)
class Full:
    """Result of a recording on a disk that became full."""

    refusal: str
    lost_s: float
    called: tuple[str, ...]


@contextmanager
def disk(size_kb: int, option: str = "rw") -> Iterator[Path]:
    """Mount a small separate file system."""
    with tempfile.TemporaryDirectory() as place:
        options = f"size={size_kb}k,{option}"
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], check=True)
        try:
            yield Path(place)
        finally:
            subprocess.run(["umount", place], check=True)


def filled(records: tuple[Record, ...], place: Path) -> Full:
    """Record like the recorder until the disk is full, and read the bag."""
    writer, whole_ns, newest_ns, refusal = BagWriter(place / "run", whole_every_s=None), 0, 0, ""
    try:
        for record in records:
            writer.write(record)
            newest_ns = max(newest_ns, record.stamp_ns)
            if record.stamp_ns - whole_ns >= WHOLE_EVERY_S * 1e9:
                whole_ns = record.stamp_ns
                writer.make_whole()
    except RecordingError as error:
        refusal = str(error)
    with suppress(RecordingError):
        writer.close()  # as the node does when it ends
    with AnyReader([place / "run"]) as reader:
        assert sum(1 for _ in reader.messages()) > 0
    held = [record for _, record in BagReader(place / "run").records()]
    last_ns = max(record.stamp_ns for record in held if isinstance(record, Scan))
    return Full(refusal, (newest_ns - last_ns) / 1e9, lossy.called(lossy.diagnosed(held)))


def refused(place: Path) -> bool:
    """Whether a recording that cannot begin gives one error line and leaves no files."""
    try:
        BagWriter(place / "run")
    except RecordingError as error:
        return "\n" not in str(error) and str(place) in str(error) and not any(place.iterdir())
    return False


def main() -> int:
    """Print the counts; exit status 1 where anything is not as it should be."""
    parser = bench_parser(__doc__)
    parser.add_argument("count", nargs="?", type=int, default=50, help="disks of each kind")
    arguments = parser.parse_args()
    count = arguments.count
    random, results = np.random.default_rng(FIRST_SEED), []
    for number in range(count):
        records = lossy.nominal(FIRST_SEED + number % RUNS, vibration=True)
        with disk(int(random.integers(*SIZES_KB))) as place:
            results.append(filled(records, place))
    full = [r for r in results if "No space left on device" in r.refusal]
    called = [r for r in full if r.called]
    lost_s = [r.lost_s for r in full]
    print(
        f"full: {len(full)} of {count} said so, all bags open; lost {np.median(lost_s):.2f} s, at "
        f"most {max(lost_s):.2f} s; fault called in the replay of {len(called)}"
    )
    for result in called:
        print(f"    {result.called[0]}")
    silent = 0
    for _ in range(count):
        with disk(100, "ro") as place:
            silent += not refused(place)
    print(f"read-only: {count - silent} of {count} refused in one line")
    seed = f"{FIRST_SEED} to {FIRST_SEED + RUNS - 1}"
    figures = (
        share("full disks: one error, bag opens", len(full), count, seed=seed),
        share("full disks: no fault called in the replay", count - len(called), count, seed=seed),
        Figure("full disks: lost of the run, median", float(np.median(lost_s)), "s", len(full),
               min(lost_s), max(lost_s), seed=seed),
        share("read-only disks: refused in one line", count - silent, count),
    )  # fmt: skip
    write_summary("disk", figures, arguments.json)
    return int(len(full) < count or bool(called) or silent > 0)


if __name__ == "__main__":
    sys.exit(main())
