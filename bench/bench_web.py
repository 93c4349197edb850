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

"""Server CPU, memory, frame rate and latency of the web page over ten minutes.

A simulated stand (100 Hz and 20 kHz) with a jam at 8 s, the diagnoser, the page, and one Chromium
without a graphics card. ``FLEA_BENCH_MINUTES`` sets the duration (10). CPU is process time over
wall time and hardly affected by other load on the machine; the frame rate is affected.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))

from summary import Figure, bench_parser, write_summary
from support.browser import Browser, chromium, missing
from support.live import Peer, Process, node

from flea_diag.nodes.run.domain import reserved_domain
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome

MINUTES = float(os.environ.get("FLEA_BENCH_MINUTES", "10"))
SAMPLE_S = 15.0
SETTLE_S = 60.0
"""Time after which the buffers are full; reference for the growth of memory."""
PORT = "8639"
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """CPU time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def resident_mb(pid: int) -> float:
    """Resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def sample(pid: int, browser: Browser) -> tuple[float, float, float, float]:
    """CPU share, resident MB, heap MB and frames a second over one stretch."""
    start, before, frames = time.monotonic(), cpu_s(pid), browser.frames()
    while time.monotonic() - start < SAMPLE_S:
        time.sleep(1.0)
    passed = time.monotonic() - start
    share, rate = (cpu_s(pid) - before) / passed, (browser.frames() - frames) / passed
    return share, resident_mb(pid), browser.heap_bytes() / 1e6, rate


def measure(domain: int, folder: Path) -> list[Figure]:
    """Run the stand and print the figures."""
    journal = f"journal:={folder / 'alarms.sqlite'}"
    web = node("web", "-p", f"port:={PORT}", "-p", journal)
    daq = node(
        "daq", "-p", "fault:=jam", "-p", "fault_onset_s:=8.0",
        "-p", f"duration_s:={60.0 * MINUTES + 60.0}", "-p", "wait_for_subscribers:=3",
    )  # fmt: skip
    with (
        Peer(domain) as peer,
        Process(node("diagnoser"), domain),
        Process(web, domain) as server,
        chromium() as browser,
    ):
        server.wait_for("the page is at")
        peer.listen(Detection, AmbiguityGroup)
        browser.open(f"http://127.0.0.1:{PORT}/")
        with Process(daq, domain):
            return report(peer, browser, server.child.pid)


def report(peer: Peer, browser: Browser, pid: int) -> list[Figure]:
    """Latency of the detection, then samples until the time is over."""
    flag = peer.find(lambda r: isinstance(r, Detection) and r.detected, 60.0)
    peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.outcome is Outcome.ISOLATED, 60.0)
    browser.until("'ISOLATED' in seen")
    seen = browser.run("seen")
    latency_ms = seen["DETECTED"] - flag.stamp_ns / 1e6
    print(f"detection on the page {latency_ms:.0f} ms after the scan that caused it")
    browser.run("document.getElementById('panel-residual').scrollIntoView()")
    start, rows = time.monotonic(), []
    while time.monotonic() - start < 60.0 * MINUTES:
        rows.append((time.monotonic() - start, *sample(pid, browser)))
        at, share, resident, heap, rate = rows[-1]
        print(
            f"{at:5.0f} s  server {share:5.1%} of a core, {resident:6.1f} MB; page heap "
            f"{heap:5.1f} MB, {rate:4.1f} frames/s",
            flush=True,
        )
    settled = [row for row in rows if row[0] >= SETTLE_S] or rows
    _, shares, residents, heaps, counted = zip(*settled, strict=True)
    rates = [rate for rate in counted if rate >= 0.0]
    loads = len(counted) - len(rates)  # a page that is loaded anew counts its frames from 0
    print(
        f"over {rows[-1][0] / 60:.1f} min: server {statistics.mean(shares):.1%} of a core (worst "
        f"{max(shares):.1%}), memory {residents[0]:.1f} -> {residents[-1]:.1f} MB; page heap "
        f"{heaps[0]:.1f} -> {heaps[-1]:.1f} MB; {statistics.median(rates):.1f} frames/s "
        f"(worst {min(rates):.1f}), loaded anew {loads} times"
    )
    n = len(settled)
    return [
        Figure("detection on the page, after its scan", latency_ms, "ms"),
        Figure("CPU of the server", 100.0 * statistics.mean(shares), "% of a core", n,
               100.0 * min(shares), 100.0 * max(shares)),
        Figure("memory of the server", residents[-1], "MB", n, min(residents), max(residents)),
        Figure("memory of the page", heaps[-1], "MB", n, min(heaps), max(heaps)),
        Figure("frames a second", statistics.median(rates), "1/s", n, min(rates), max(rates)),
    ]  # fmt: skip


def main() -> int:
    """Measure; the exit status."""
    arguments = bench_parser(__doc__).parse_args()
    if missing():
        print(missing(), file=sys.stderr)
        return 2
    with reserved_domain() as domain, tempfile.TemporaryDirectory() as folder:
        figures = measure(domain, Path(folder))
    write_summary("web", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
