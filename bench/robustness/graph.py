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

"""Whole graphs in one seeded scheduler, with what goes wrong drawn by the seed; many hours of them.

python bench/robustness/graph.py 500                 500 graphs of half a minute; Ctrl-C ends it
python bench/robustness/graph.py 1 --seed 1234       one again: it replays exactly
python bench/robustness/graph.py 0 --disk            each operation of each command fails
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from summary import Figure, bench_parser, share, write_summary
from support.disk.failing_commands import WRITING, failed, operations
from support.graph.judged import Judged, flown

MOST_OPERATIONS = 200
"""Of a command that has more, the first and the last hundred fail."""


def main() -> int:
    """One line for each graph or operation with something wrong."""
    parser = bench_parser(__doc__)
    parser.add_argument("count", nargs="?", type=int, default=100, help="graphs")
    parser.add_argument("--seed", type=int, default=10_000, help="of the first (default 10000)")
    parser.add_argument("--disk", action="store_true", help="and the operations of commands")
    args = parser.parse_args()
    figures: list[Figure] = []
    wrong = _graphs(args.seed, args.count, figures) if args.count else 0
    wrong += _commands(figures) if args.disk else 0
    write_summary("graph", figures, args.json)
    return min(wrong, 1)


def _graphs(seed: int, count: int, figures: list[Figure]) -> int:
    found: list[Judged] = []
    with suppress(KeyboardInterrupt):  # what is done by then counts
        for each in range(seed, seed + count):
            found.append(_told(each))
            if len(found) % 20 == 0:
                hours = sum(graph.graph_s for graph in found) / 3600.0
                print(f"{len(found)} graphs, {hours:.2f} h of graph time", flush=True)
    count, drawn = len(found), f"{seed} to {seed + len(found) - 1}"
    bad = sum(bool(graph.wrong) for graph in found)
    hours = sum(graph.graph_s for graph in found) / 3600.0
    kinds = Counter(words.split(" at ")[0][:40] for graph in found for words in graph.wrong)
    for words, number in kinds.most_common():
        print(f"{number:4d} {words}")
    figures += [
        share("graphs in which nothing is wrong", count - bad, count, seed=drawn),
        Figure("graph time", hours, "h", count, seed=drawn),
    ]
    return bad


def _told(seed: int) -> Judged:
    with tempfile.TemporaryDirectory() as folder:
        found = flown(seed, Path(folder) / "graph")
    for words in found.wrong:
        print(f"seed {seed}: {found.words}: {words}", flush=True)
    return found


def _commands(figures: list[Figure]) -> int:
    bad = 0
    for name in WRITING:
        with tempfile.TemporaryDirectory() as folder:
            wrong, count = _command(name, Path(folder) / "disk")
        bad += wrong
        figures.append(
            share(f"{name}: operations whose failure leaves nothing half", count - wrong, count)
        )
    return bad


def _command(name: str, folder: Path) -> tuple[int, int]:
    count, whole = operations(name, folder)
    half = MOST_OPERATIONS // 2
    numbers = [k for k in range(1, count + 1) if k <= half or k > count - half]
    found = [failed(name, number, folder, whole) for number in numbers]
    for each in found:
        if each.wrong:
            print(f"{name}: operation {each.number}, {each.operation}: {each.wrong}", flush=True)
    wrong = sum(bool(each.wrong) for each in found)
    print(f"{name}: {len(numbers)} of {count} operations, {wrong} wrong", flush=True)
    return wrong, len(numbers)


if __name__ == "__main__":
    sys.exit(main())
