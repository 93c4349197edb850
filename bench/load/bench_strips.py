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

"""CPU of the browser for 40 strip charts at 100 Hz, all of them in view.

A desk in this process is fed 40 residuals at 100 Hz; Chromium without a graphics card shows all of
their charts. CPU is process time over wall time, of all processes of the browser;
beside other load the browser draws less often, so the frame rate stands beside it.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import threading
import time
from pathlib import Path

os.environ.setdefault("PYTEST_CURRENT_TEST", Path(__file__).name)
# NiceGUI lets several pages follow each other in a process for tests alone.
BENCH = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(BENCH), str(BENCH.parent / "test")]

from summary import Figure, bench_parser, write_summary
from support.browser import Browser, missing
from support.screens.page_session import PageSession, page_session
from support.screens.shift import descendants
from support.verdicts import NOMINAL

from flea_diag.wire.records import Residual

COUNT, RATE_HZ = 40, 100.0
NAMES = tuple(f"residual_{k:02d}" for k in range(COUNT))
SETTLE_S, SAMPLE_S, SAMPLES = 12.0, 10.0, 3
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
IN_VIEW = "[...document.querySelectorAll('#panel-residual .strip')].filter(e => e.offsetParent)"


def feed(session: PageSession, ended: threading.Event) -> None:
    """Residuals at their rate, each with a course of its own."""
    count, due_s = 0, time.monotonic()
    while not ended.is_set():
        z = tuple(math.sin(count / 40.0 + k) for k in range(COUNT))
        session.desk.take(Residual(time.time_ns(), NAMES, (0.0,) * COUNT, z, (5.0,) * COUNT))
        count, due_s = count + 1, due_s + 1.0 / RATE_HZ
        if count % round(RATE_HZ) == 0:
            session.take(NOMINAL)
        ended.wait(max(due_s - time.monotonic(), 0.0))


def cpu_s(pid: int) -> float:
    """CPU time of a process; none of one that has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) * TICK_S


def share(browser: Browser) -> tuple[float, float]:
    """CPU of the browser as a share of a core, and frames a second."""
    pids = descendants(browser.driver.service.process.pid)
    before, frames, start = sum(map(cpu_s, pids)), browser.frames(), time.monotonic()
    time.sleep(SAMPLE_S)
    passed = time.monotonic() - start
    return (sum(map(cpu_s, pids)) - before) / passed, (browser.frames() - frames) / passed


def measure(folder: Path) -> list[Figure]:
    """Feed, open, and sample."""
    with page_session(folder) as session:
        browser, ended = session.browser, threading.Event()
        feeder = threading.Thread(target=feed, args=(session, ended))
        feeder.start()
        try:
            browser.size(1920, 3000)
            browser.open(session.url)
            browser.until_text("#panel-residual", NAMES[0])
            browser.run("(document.querySelector('[data-strip=all]').click(), true)")
            browser.run("(document.getElementById('panel-residual').scrollIntoView(), true)")
            browser.until(f"{IN_VIEW}.length === {COUNT}")
            time.sleep(SETTLE_S)
            rows = [share(browser) for _ in range(SAMPLES)]
        finally:
            ended.set()
            feeder.join()
    shares, rates = ([row[k] for row in rows] for k in (0, 1))
    print(f"load {os.getloadavg()[0]:.1f}; {COUNT} strips at {RATE_HZ:.0f} Hz:")
    print(", ".join(f"{s:.1%} of a core at {r:.2f} frames/s" for s, r in rows))
    return [
        Figure("CPU of the browser, 40 strips at 100 Hz", 100.0 * sum(shares) / SAMPLES,
               "% of a core", SAMPLES, 100.0 * min(shares), 100.0 * max(shares)),
        Figure("frames a second, 40 strips", sum(rates) / SAMPLES, "1/s", SAMPLES,
               min(rates), max(rates)),
    ]  # fmt: skip


def main() -> int:
    """Measure; the exit status."""
    arguments = bench_parser(__doc__).parse_args()
    if missing():
        print(missing(), file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(Path(folder))
    write_summary("strips", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
