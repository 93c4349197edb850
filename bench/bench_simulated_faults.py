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

"""Simulated faults compared with the expected groups: correct results by row.

scripts/bench simulated_faults            8 seeds per row
python bench/bench_simulated_faults.py 60 winding_short load_force_noise
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from summary import Figure, bench_parser, share, write_summary
from support.simulated_faults import Judged, judged, table

from flea_diag.tools.interval import wilson

FIRST_SEED = 500
WORKERS = 2


def main() -> int:
    """Run and print; seeds from ``FIRST_SEED`` on."""
    known = list(table()["faults"])
    parser = bench_parser(__doc__)
    parser.add_argument("count", nargs="?", type=int, default=8, help="seeds a row")
    parser.add_argument("rows", nargs="*", metavar="ROW", help="default: all")
    arguments = parser.parse_args()
    count, rows = arguments.count, arguments.rows or known
    unknown = [row for row in rows if row not in known]
    if unknown:
        sys.exit(f"{unknown[0]!r} is no row, choose of {', '.join(known)}")
    pairs = list(product(rows, range(FIRST_SEED, FIRST_SEED + count)))
    with ProcessPoolExecutor(WORKERS) as pool:
        found = list(pool.map(judged, *zip(*pairs, strict=True), chunksize=4))
    figures = [report([each for each in found if each.row == row]) for row in rows]
    write_summary("simulated_faults", [*figures, report(found, "all")], arguments.json)
    return 0


def report(runs: list[Judged], name: str = "") -> Figure:
    """One line of counts, and one for each miss."""
    right = [run for run in runs if run.right]
    low, high = wilson(len(right), len(runs))
    delays = sorted(run.delay_s for run in right)
    middle = f"{delays[len(delays) // 2]:5.2f} s" if delays else "      -"
    print(
        f"{name or runs[0].row:24s} {len(right):3d} of {len(runs):3d} right  "
        f"[{100 * low:.1f}, {100 * high:.1f}] %  median delay {middle}"
    )
    for run in runs:
        if not (run.right or name):
            words = "early " if run.early else ""
            print(f"    seed {run.seed}: {words}{run.outcome} {', '.join(run.group[:6])}")
    return share(name or runs[0].row, len(right), len(runs), seed=f"{FIRST_SEED} and on")


if __name__ == "__main__":
    sys.exit(main())
