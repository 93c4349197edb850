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

"""Recordings in drawn dialects: the same stand and verdict as from the plain one, or a true line.

python bench/robustness/dialects.py                     1300 tables, 700 bags
python bench/robustness/dialects.py 200 100 --seed 9    fewer, of other seeds
Ctrl-C ends the tables, a second one the bags; what is done by then counts.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary
from support.foreign.dialect_verdicts import DialectVerdicts
from support.foreign.dialect_walk import Walked, walked_bag, walked_table

Walk = Callable[[Path, int, DialectVerdicts], Walked]


def main() -> int:
    """One line for each recording that is neither right nor refused in one line."""
    parser = bench_parser(__doc__)
    parser.add_argument("tables", nargs="?", type=int, default=1300)
    parser.add_argument("bags", nargs="?", type=int, default=700)
    parser.add_argument("--seed", type=int, default=20_000, help="of the first (default 20000)")
    args = parser.parse_args()
    kinds = (("tables", walked_table, args.tables), ("bags", walked_bag, args.bags))
    figures, wrong = [], 0
    with tempfile.TemporaryDirectory() as stands:
        for name, walk, count in kinds:
            seeds = range(args.seed, args.seed + count)
            found = _walked(name, walk, seeds, DialectVerdicts(Path(stands) / name))
            bad = sum(bool(each.wrong) for each in found)
            if found:
                figures.append(_figure(name, len(found), bad, args.seed))
            wrong += bad
    write_summary("bench/robustness/dialects.py", figures, args.json)
    return min(wrong, 1)


def _figure(name: str, count: int, bad: int, first: int) -> Figure:
    words = f"{name}: the stand, the scans and the verdict of the plain one, or one line"
    return share(words, count - bad, count, seed=f"{first} to {first + count - 1}")


def _walked(name: str, walk: Walk, seeds: range, verdicts: DialectVerdicts) -> list[Walked]:
    found: list[Walked] = []
    with suppress(KeyboardInterrupt):
        for seed in seeds:
            found.append(_told(walk, seed, verdicts))
            if len(found) % 100 == 0:
                bad = sum(bool(each.wrong) for each in found)
                print(f"{name:6s} {len(found)} of {len(seeds)}: {bad} wrong", flush=True)
    bad, refused = sum(bool(e.wrong) for e in found), sum(e.status != 0 for e in found)
    print(f"{name:6s} n = {len(found)}: {bad} wrong, {refused} refused in one line, "
          f"{len(verdicts.without)} too slow to calibrate by, in the unit that was taken, "
          f"{len(verdicts.otherwise)} that lack readings told otherwise and rightly",
          flush=True)  # fmt: skip
    return found


def _told(walk: Walk, seed: int, verdicts: DialectVerdicts) -> Walked:
    with tempfile.TemporaryDirectory() as folder:
        found = walk(Path(folder) / "walk", seed, verdicts)
    if found.wrong:
        print(f"seed {seed}: {found.words}: {found.wrong}", flush=True)
    return found


if __name__ == "__main__":
    sys.exit(main())
