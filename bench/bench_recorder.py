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

"""CPU and losses of the recorder on a live simulated stand.

The DAQ publishes 100 scans/s and two accelerometers of three axes at 20 kHz; the recorder records
everything. Lost messages are those sent by the DAQ but missing in the bag, by stamps; losses
reported by DDS are counted as well.

    scripts/bench recorder                   10 minutes
    python bench/bench_recorder.py --for 60  shorter
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "test")]

import numpy as np
from bench_stand import cpu_s
from summary import Figure, bench_parser, share, write_summary
from support.live import Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import Scan, VibrationBlock

RATES_HZ = {Scan: 100.0, VibrationBlock: 10.0}
LIMIT = 0.10


def recorded(bag: Path, seconds: float) -> tuple[float, float]:
    """Share of a core and peak memory, MB, of the recorder from the first to the last scan."""
    keep = node("recorder", "-p", f"directory:={bag}", "-p", "clips:=false")
    send = node("daq", "-p", f"duration_s:={seconds}",
                "-p", "wait_for_subscribers:=1")  # fmt: skip
    with (
        reserved_domain() as domain,
        Process(keep, domain) as recorder,
        Process(send, domain) as daq,
    ):
        time.sleep(10.0)  # imports and discovery are not what is measured
        began, spent = time.monotonic(), cpu_s(recorder.child.pid)
        while daq.child.poll() is None:
            daq.read()
            recorder.read()
            took, used = time.monotonic() - began, cpu_s(recorder.child.pid) - spent
            memory = peak_mb(recorder.child.pid)
            time.sleep(1.0)
        recorder.signal(signal.SIGINT)
    return used / took, memory


def peak_mb(pid: int) -> float:
    """Largest resident memory of a running process so far, MB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1e3


def missing(bag: Path, kind: type, seconds: float) -> tuple[int, int, int]:
    """Messages of a type: number recorded, number lost, most lost in a row."""
    stamps_ns = np.array([record.stamp_ns for _, record in BagReader(bag).records((kind,))])
    sent = round(seconds * RATES_HZ[kind])
    gaps = np.rint(np.diff(stamps_ns) / 1e9 * RATES_HZ[kind]).astype(int) - 1
    return len(stamps_ns), max(int(gaps.sum()), sent - len(stamps_ns)), int(gaps.max())


def main() -> None:
    """Print what the recorder cost and what it lost."""
    parser = bench_parser(__doc__)
    parser.add_argument("--for", dest="seconds", type=float, default=600.0)
    arguments = parser.parse_args()
    seconds = arguments.seconds
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        used, memory = recorded(bag, seconds)
        size_mb = sum(path.stat().st_size for path in bag.iterdir()) / 1e6
        print(f"{seconds:.0f} s: {100.0 * used:.1f} % of a core (limit {100.0 * LIMIT:.0f} %)")
        print(f"{memory:.0f} MB of memory, {size_mb:.0f} MB of bag; load {os.getloadavg()[0]:.1f}")
        figures = [
            Figure("CPU of the recorder", 100.0 * used, "% of a core"),
            Figure("memory of the recorder, peak", memory, "MB"),
        ]
        for kind in RATES_HZ:
            held, lost, longest = missing(bag, kind, seconds)
            print(f"{kind.__name__:15s} {held} recorded, {lost} lost, {longest} at most in a row")
            figures.append(share(f"{kind.__name__} recorded", held, held + lost))
    write_summary("recorder", figures, arguments.json)


if __name__ == "__main__":
    main()
