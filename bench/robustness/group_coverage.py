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

"""Whether groups hold the fault as often as a stated coverage says.

The runs of config/campaigns/coverage.yaml set the limits (`flea coverage`), those of
bench/robustness/group_coverage.yaml, drawn alike by other seeds, are scored by them. Runs without
an alarm have no group and do not count.

    .venv/bin/python bench/robustness/group_coverage.py --json coverage.json
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "bench")]

from summary import Figure, bench_parser, share, write_summary

from flea_diag.core.calibration.out_of_sample import GroupCoverage
from flea_diag.stages.isolator.parameters import IsolatorParameters
from flea_diag.tools.main import main as flea

SETS = ROOT / "config/campaigns/coverage.yaml"
SCORED = ROOT / "bench/robustness/group_coverage.yaml"
STATED = (0.5, 0.7, 0.8, 0.9, 0.95, 0.98)


def scores(path: Path) -> GroupCoverage:
    """Least limits, in nats, that keep the fault of each run of a campaign."""
    with TemporaryDirectory() as folder:
        told = Path(folder) / "told.json"
        flea(["coverage", str(path), "-o", f"{folder}/calibration.yaml", "--json", str(told)])
        content = json.loads(told.read_text(encoding="utf-8"))
    nats = tuple(sorted(row["nats"] for row in content["scores"] if row["nats"] is not None))
    return GroupCoverage(path.stem, nats, content["runs"] - len(nats), content["missed"])


def figures(sets: GroupCoverage, scored: GroupCoverage) -> Iterator[Figure]:
    """Share of groups that hold the fault, at each stated coverage and by the shipped limit."""
    limits = {f"stated {100 * stated:g} %": sets.limit_nats(stated) for stated in STATED}
    limits["by the shipped limit"] = IsolatorParameters().drop_nats
    for name, limit in limits.items():
        said = "any" if math.isinf(limit) else f"{limit:g}"
        held = sum(nats <= limit for nats in scored.nats)
        print(f"{name}: limit {said} nats, {held} of {scored.runs} groups hold the fault")
        yield share(f"{name}, {said} nats: in the group", held, scored.runs)
    print(f"without an alarm: {sets.missed} of those that set, {scored.missed} of those scored")


def main() -> None:
    """Score both campaigns, and write."""
    arguments = bench_parser(__doc__).parse_args()
    found = list(figures(scores(SETS), scores(SCORED)))
    write_summary("bench/robustness/group_coverage.py", found, arguments.json)


if __name__ == "__main__":
    main()
