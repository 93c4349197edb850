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

"""What each condition of Cranfield's stand ends in, by load, from an evaluation of its campaign.

    flea import --stand cranfield cranfield/*.csv.gz -o bags
    flea evaluate config/campaigns/cranfield.yaml -o out       (FLEA_DATA_DIR: folder above bags)
    python bench/stands/cranfield_conditions.py out --json conditions.json

Each half of the normal tests calibrates once and scores the other; faulty tests are scored with
both halves, so n counts scores, two a test.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench")]

from summary import Figure, bench_parser, share, write_summary

NAME = "bench/stands/cranfield_conditions.py"
CASE = re.compile(r"real/([a-zA-Z]+)(\d*)_(-?\d+)_\d+")
SPALLS = {number: "1 to 5" if number in "12345" else "6 to 8" for number in "12345678"}
LARGEST_GROUP = 3

Scores = dict[tuple[str, str], list[dict[str, Any]]]


def by_condition(path: Path) -> Scores:
    """Results by condition and load, in the order of the names."""
    found: Scores = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        result = json.loads(line)
        case = CASE.fullmatch(result["id"])
        if case is None:
            raise SystemExit(f"{path}: {result['id']} is no test of Cranfield's stand")
        name, degree, load = case.groups()
        name = f"{name} {SPALLS[degree]}" if name == "spalling" else name + degree
        found.setdefault((name, f"{int(load):+d} kgf"), []).append(result)
    return dict(sorted(found.items()))


def figures(scores: Scores) -> Iterator[Figure]:
    """Share of alarms and, where there are faults, of groups that hold the fault."""
    for (name, load), results in scores.items():
        where, count = f"{name}, {load}", len(results)
        yield share(f"{where}: alarm", sum(bool(r["detected_stamp_ns"]) for r in results), count)
        if not results[0]["expected"]:
            continue
        groups = [r["group"] for r in results if r["truth"] in r["group"]]
        if any(r["detected_stamp_ns"] for r in results):
            few = sum(len(group) <= LARGEST_GROUP for group in groups)
            yield share(f"{where}: fault in the group", len(groups), count)
            yield share(f"{where}: in a group of at most {LARGEST_GROUP}", few, count)


def main() -> int:
    """Print, and write the summary."""
    parser = bench_parser(__doc__)
    parser.add_argument("evaluation", type=Path, metavar="OUT", help="folder of flea evaluate")
    arguments = parser.parse_args()
    found = list(figures(by_condition(arguments.evaluation / "results.jsonl")))
    for figure in found:
        print(f"{figure.name:60s} {figure.value:6.1f} % of {figure.n}")
    write_summary(NAME, found, arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
