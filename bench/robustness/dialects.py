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

"""Recordings in drawn dialects: the same stand as from the plain one, or one true line.

python bench/robustness/dialects.py                     1300 tables, 700 bags
python bench/robustness/dialects.py 200 100 --seed 9    fewer, of other seeds
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import bench_parser, share, write_summary
from support.foreign.dialect_walk import Walked, walked_bag, walked_table


def main() -> int:
    """One line for each recording that is neither right nor refused in one line."""
    parser = bench_parser(__doc__)
    parser.add_argument("tables", nargs="?", type=int, default=1300)
    parser.add_argument("bags", nargs="?", type=int, default=700)
    parser.add_argument("--seed", type=int, default=20_000, help="of the first (default 20000)")
    args = parser.parse_args()
    figures, wrong = [], 0
    kinds = (("tables", walked_table, args.tables), ("bags", walked_bag, args.bags))
    for name, walk, count in kinds:
        seeds = range(args.seed, args.seed + count)
        found = []
        for seed in seeds:
            found.append(_told(walk, seed))
            if len(found) % 100 == 0:
                bad = sum(bool(each.wrong) for each in found)
                print(f"{name:6s} {len(found)} of {count}: {bad} wrong", flush=True)
        bad = sum(bool(each.wrong) for each in found)
        refused = sum(each.status != 0 for each in found)
        figures.append(
            share(
                f"{name}: the stand and the scans of the plain one, or one line",
                count - bad,
                count,
                seed=f"{seeds[0]} to {seeds[-1]}",
            )
        )
        wrong += bad
        print(f"{name:6s} n = {count}: {bad} wrong, {refused} refused in one line", flush=True)
    write_summary("dialects", figures, args.json)
    return min(wrong, 1)


def _told(walk: Callable[[Path, int], Walked], seed: int) -> Walked:
    with tempfile.TemporaryDirectory() as folder:
        found = walk(Path(folder) / "walk", seed)
    if found.wrong:
        print(f"seed {seed}: {found.words}: {found.wrong}", flush=True)
    return found


if __name__ == "__main__":
    sys.exit(main())
