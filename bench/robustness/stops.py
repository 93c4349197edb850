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

"""Ends nodes at random moments of start-up and run, by SIGINT and SIGTERM: how soon, how cleanly.

Compiled code is kept in an empty folder, so that most moments fall into compiling.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))

from support.live import environment

from flea_diag.nodes.executables import EXECUTABLES
from flea_diag.nodes.run.domain import reserved_domain

LIMIT_S = 1.0
GIVEN_UP_S = 60.0
LATEST_S = 20.0
"""Most moments of a start with an empty cache lie before this."""
NODES = ("diagnoser", "observer", "isolator", "extractor", "recorder", "console", "daq")


@dataclass(frozen=True)
class Stop:
    """One process that was told to end: how long after its start, and how it ended."""

    node: str
    signal: str
    after_s: float
    took_s: float
    status: int
    traceback: bool

    @property
    def clean(self) -> bool:
        """Within the limit, with status 0 and without a traceback."""
        return self.took_s <= LIMIT_S and self.status == 0 and not self.traceback


def stop(name: str, number: signal.Signals, after_s: float, domain: int, folder: Path) -> Stop:
    """Start a node, tell it to end after so long, and wait for that."""
    held = ["env", "--block-signal=INT,TERM"]  # as its launcher does
    command = [*held, sys.executable, "-m", "flea_diag.nodes.main", name]
    with tempfile.TemporaryDirectory(dir=folder) as cache, tempfile.TemporaryFile() as output:
        child = subprocess.Popen(
            command,
            env=environment(domain, NUMBA_CACHE_DIR=cache, HOME=cache),
            cwd=cache,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(after_s)
        begin = time.monotonic()
        child.send_signal(number)
        try:
            child.wait(GIVEN_UP_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        took_s = time.monotonic() - begin
        output.seek(0)
        said = output.read().decode(errors="replace")
    return Stop(name, number.name, after_s, took_s, child.returncode, "Traceback" in said)


def main() -> int:
    """Run and print; exit status 1 where one did not end as it should."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stops", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE")
    given = parser.parse_args()
    draw = random.Random(given.seed)
    assert set(NODES) <= set(EXECUTABLES)
    stops = []
    with tempfile.TemporaryDirectory() as folder, reserved_domain() as domain:
        for number in range(given.stops):
            # Half of the moments within the first second: Python, imports, rclpy.
            after_s = draw.uniform(0.0, 1.0 if number % 2 else LATEST_S)
            kind = draw.choice((signal.SIGINT, signal.SIGTERM))
            stops.append(stop(NODES[number % len(NODES)], kind, after_s, domain, Path(folder)))
            one = stops[-1]
            print(
                f"{one.node:10} {one.signal:8} after {one.after_s:6.2f} s: {one.took_s:5.2f} s, "
                f"status {one.status}{'' if one.clean else '  NOT CLEAN'}",
                flush=True,
            )
    clean = sum(one.clean for one in stops)
    slowest = max(one.took_s for one in stops)
    load = os.getloadavg()[0]
    print(f"{clean} of {len(stops)} clean, slowest {slowest:.2f} s, load average {load:.1f}")
    if given.json:
        rows = [asdict(one) for one in stops]
        given.json.write_text(json.dumps({"load": load, "stops": rows}, indent=1) + "\n", "utf-8")
    return 0 if clean == len(stops) else 1


if __name__ == "__main__":
    sys.exit(main())
