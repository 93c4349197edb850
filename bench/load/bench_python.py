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

"""The Python interface: import, first verdict, and a million rows against the replay of their bag.

    scripts/bench python

Import and first verdict are measured in processes of their own, from a warm cache. The rows are a
nominal recording run to and fro; the bag holds the same ones.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parents[1])]

from summary import Figure, bench_parser, write_summary

import flea_diag as fd
from flea_diag.api.columns import recording_of
from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.tools.replay.replay import replay

TURNS = 5
BAG = HERE.parents[1] / "bags" / "winding_short"
IMPORT = "import time; t = CLOCK(); import flea_diag as fd; "
VERDICT = f"fd.diagnose({str(BAG)!r}).outcome; "
TOOK = "print(CLOCK() - t)"
CLOCKS = {"s": "time.perf_counter", "s of CPU": "time.process_time"}


def in_a_process(code: str, clock: str) -> list[float]:
    """Seconds that the code takes in each of some processes, the first of which is not counted."""
    command = [sys.executable, "-c", (IMPORT + code + TOOK).replace("CLOCK", clock)]
    places = HERE.parent / "without_tests", HERE.parents[1]  # as installed: see bench_replay.py
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": os.pathsep.join(map(str, places)), "OPENBLAS_NUM_THREADS": "1"}
    done = [
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        for _ in range(TURNS + 1)
    ]
    return [float(each.stdout) for each in done[1:]]


def rows_of(count: int) -> fd.Table:
    """A nominal recording of this many rows, repeated forwards and backwards."""
    table = fd.open(BAG.parent / "nominal").table
    repeats = count // (2 * table.rows) + 1
    columns = {
        name: np.tile(np.concatenate([values, values[::-1]]), repeats)[:count]
        for name, values in table.items()
        if name != "time_s" and np.isfinite(values).any()
    }
    return fd.Table({"time_s": np.arange(count) * 0.01, **columns}, attrs=table.attrs)


def spread(name: str, values: list[float], unit: str) -> Figure:
    """The median of some values, with their extremes."""
    middle = statistics.median(values)
    print(f"{name}: {middle:.4g} {unit} ({min(values):.4g} to {max(values):.4g})")
    return Figure(name, middle, unit, len(values), min(values), max(values))


def rates(count: int) -> list[Figure]:
    """Rows a second of CPU time, from memory and by the replay of a bag of the same rows."""
    table, stand = rows_of(count), load_stand()
    fd.diagnose(BAG)  # loads what is compiled
    begin = time.process_time()
    result = fd.diagnose(table)
    own_s = time.process_time() - begin
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "rows"
        recording_of(table, stand).save(bag)
        begin = time.process_time()
        told = replay(bag, make_pipeline(stand))
        replay_s = time.process_time() - begin
    assert told["decision_digest"] == result.summary["decision_digest"]
    print(f"{count} rows: {count / own_s:.0f} a second, replay {count / replay_s:.0f}")
    return [
        Figure("rows through fd.diagnose", count / own_s, "rows/s of CPU", 1),
        Figure("rows through fd.diagnose", replay_s / own_s, "x", 1, against="their replay"),
    ]


def main() -> None:
    """Measure and write."""
    parser = bench_parser(__doc__)
    parser.add_argument(
        "--rows", type=int, default=1_000_000, help="rows (default %(default)s); 0: none"
    )
    arguments = parser.parse_args()
    figures = [
        spread(name, in_a_process(code, clock), unit)
        for name, code in (("import", ""), ("import and first verdict on 24 s of scans", VERDICT))
        for unit, clock in CLOCKS.items()
    ]
    figures += rates(arguments.rows) if arguments.rows else []
    write_summary("python", figures, arguments.json)


if __name__ == "__main__":
    main()
