"""Healthy runs recorded on disks that run full at random moments, or may not be written at all.

    scripts/bench disk          50 disks of each kind; needs the right to mount
    python bench/bench_disk.py 5

Checked on a full disk: one clear error, a bag that opens as it is, also with another library, what
was lost of the run, and what its replay calls. On a read-only one: one clear error, nothing left.
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
from support import lossy

from flea_diag.errors import RecordingError
from flea_diag.nodes.recording.recorder import WHOLE_EVERY_S
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.records import Record, Scan

FIRST_SEED = 5000
RUNS = 5
"""Healthy runs of a unit each, recorded in turn."""
SIZES_KB = (300, 6000)
"""A run of 20 s takes more."""


@dataclass(frozen=True)
class Full:
    """What became of a recording on a disk that ran full."""

    refusal: str
    lost_s: float
    called: tuple[str, ...]


@contextmanager
def disk(size_kb: int, option: str = "rw") -> Iterator[Path]:
    """A small file system of its own."""
    with tempfile.TemporaryDirectory() as place:
        options = f"size={size_kb}k,{option}"
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], check=True)
        try:
            yield Path(place)
        finally:
            subprocess.run(["umount", place], check=True)


def filled(records: tuple[Record, ...], place: Path) -> Full:
    """Record until the disk refuses, as the recorder does, and read what is there."""
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
        writer.close()  # as the node does on its way out
    with AnyReader([place / "run"]) as reader:
        assert sum(1 for _ in reader.messages()) > 0
    held = [record for _, record in BagReader(place / "run").records()]
    last_ns = max(record.stamp_ns for record in held if isinstance(record, Scan))
    return Full(refusal, (newest_ns - last_ns) / 1e9, lossy.called(lossy.diagnosed(held)))


def refused(place: Path) -> bool:
    """Whether a recording that cannot begin says so in one line and leaves nothing."""
    try:
        BagWriter(place / "run")
    except RecordingError as error:
        return "\n" not in str(error) and str(place) in str(error) and not any(place.iterdir())
    return False


def main() -> int:
    """Print the counts; exit status 1 where anything is not as it should be."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 50
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
    return int(len(full) < count or bool(called) or silent > 0)


if __name__ == "__main__":
    sys.exit(main())
