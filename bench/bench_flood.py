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

"""Memory of the page's server before, during and after a flood, and connections left half open.

2000 loads of the page without a WebSocket, from this machine, then 500 connections that send half
a request. ``FLEA_BENCH_MINUTES`` sets how long the memory is looked at afterwards (5).
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))

from summary import Figure, bench_parser, write_summary
from support.live import Process, node

from flea_diag.nodes.run.domain import reserved_domain

MINUTES = float(os.environ.get("FLEA_BENCH_MINUTES", "5"))
LOADS, HALF_OPEN = 2000, 500
PORT = 8641
LIMIT_S = 60.0
SAYS_WHERE = "the page is at"


def resident_mb(pid: int) -> float:
    """Resident memory of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text("ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1e3


def loaded() -> int:
    """Load the page once; the status of the answer, 0 for none."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/", timeout=LIMIT_S) as answer:
            answer.read()
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code
    except OSError:
        return 0


def flood(pid: int) -> tuple[Counter[int], float]:
    """Load the page again and again; answers by status, and the largest memory meanwhile."""
    answers, most_mb = Counter[int](), 0.0
    for number in range(LOADS):
        answers[loaded()] += 1
        if number % 20 == 0:
            most_mb = max(most_mb, resident_mb(pid))
    return answers, most_mb


def half_open() -> tuple[int, float]:
    """Open connections that send half a request; those that the server closed, and when."""
    begin_s = time.monotonic()
    closed = 0
    with contextlib.ExitStack() as opened:
        waiting = []
        for _ in range(HALF_OPEN):
            connection = socket.create_connection(("127.0.0.1", PORT), timeout=LIMIT_S)
            waiting.append(opened.enter_context(connection))
            connection.sendall(b"GET / HTTP/1.1\r\nHo")
        for connection in waiting:
            with contextlib.suppress(TimeoutError):
                try:
                    closed += connection.recv(1000)[:1] in (b"", b"H")
                except ConnectionResetError:
                    closed += 1
    return closed, time.monotonic() - begin_s


def measure(domain: int, folder: Path) -> list[Figure]:
    """Flood a page and print the figures."""
    given = ("-p", f"port:={PORT}", "-p", f"journal:={folder / 'alarms.sqlite'}")
    with Process(node("web", *given), domain) as web:
        web.wait_for(SAYS_WHERE)
        loaded()
        pid = web.child.pid
        before_mb = resident_mb(pid)
        answers, during_mb = flood(pid)
        closed, took_s = half_open()
        soon_mb = resident_mb(pid)
        deadline_s = time.monotonic() + 60.0 * MINUTES
        while time.monotonic() < deadline_s:
            time.sleep(5.0)
        after_mb = resident_mb(pid)
        answers_now = loaded()
    n = LOADS
    print(f"answers {dict(answers)}, in the end {answers_now}")
    return [
        Figure("page server, resident memory before the flood", before_mb, "MB"),
        Figure("during 2000 loads without a WebSocket, at most", during_mb, "MB", n),
        Figure("at their end", soon_mb, "MB", n),
        Figure(f"{MINUTES:g} min later", after_mb, "MB", n),
        Figure("loads that were answered with a page", answers[200], "loads", n),
        Figure("loads that were refused (429)", answers[429], "loads", n),
        Figure("half-open connections that the server closed", closed, "connections", HALF_OPEN),
        Figure("all of them closed after", took_s, "s", HALF_OPEN),
    ]


def main() -> int:
    """Measure; 1 where the page does not answer in the end."""
    arguments = bench_parser(__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder, reserved_domain() as domain:
        figures = measure(domain, Path(folder))
    for figure in figures:
        print(f"{figure.name:60s} {figure.value:10.1f} {figure.unit}")
    write_summary("flood", figures, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
