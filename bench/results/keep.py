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

"""Keeps the result of an evaluation or of a bench for docs/results.

scripts/keep results/table4 --as table4 --title "Table 4" --scored-on "seed 55, once"
scripts/keep results/bench/scan.json --as scan --title "One scan"

FROM is the folder of `flea evaluate` or the JSON of `scripts/bench --json`. Run scripts/results
afterwards, and commit what it wrote.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from kept import FOLDER, KeptResult, KeptRow, Origin, write_kept

TIMES = ("us", "ms", "s", "s of CPU")
OF_AN_EVALUATION = 2
"""Oldest version of an evaluation's summary that says when and from what it was made."""


def main() -> int:
    """Convert and write; 2 where that is refused."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, metavar="FROM")
    parser.add_argument("--as", dest="name", required=True, help="name of the kept file")
    parser.add_argument("--title", required=True, help="heading of its table")
    parser.add_argument("--developed-on", default="", help="runs that the method was tuned on")
    parser.add_argument("--scored-on", default="", help="runs behind the figures")
    parser.add_argument("--note", action="append", default=[], help="a sentence above the table")
    parser.add_argument("--ratios", action="store_true", help="a bench: leave out absolute times")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="default: docs/results/kept")
    arguments = parser.parse_args()
    try:
        kept = converted(arguments)
    except (OSError, ValueError, KeyError) as error:
        print(f"keep: {arguments.source}: {error}", file=sys.stderr)
        return 2
    write_kept(arguments.folder / f"{arguments.name}.json", kept)
    return 0


def converted(arguments: argparse.Namespace) -> KeptResult:
    """A summary or a report in the form in which results are kept.

    Raises
    ------
    ValueError
        The file is neither, or it is a summary without its origin.
    """
    source: Path = arguments.source
    evaluation = source.is_dir()
    path = source / "summary.json" if evaluation else source
    content = json.loads(path.read_text(encoding="utf-8"))
    make = of_evaluation if evaluation else of_bench
    return make(content, arguments)


def of_evaluation(summary: dict[str, Any], arguments: argparse.Namespace) -> KeptResult:
    """Rows of all parts, each part's false alarms after them."""
    version = summary["schema_version"]
    if version < OF_AN_EVALUATION or not summary["dates"]:
        raise ValueError(
            f"schema_version is {version}, and its lines have no date or commit: evaluate anew"
        )
    if summary["failed"]:
        raise ValueError(f"{summary['failed']} runs failed: repeat the same flea evaluate")
    if not arguments.scored_on:
        raise ValueError("say with --scored-on what these runs are")
    parts = summary["parts"]
    seeds = sorted({str(part["seed"]) for part in parts if part["seed"] is not None})
    return KeptResult(
        arguments.title,
        f"flea evaluate {summary['campaign']}.yaml",
        Origin(
            summary["dates"][-1],
            ", ".join(summary["commits"]),
            ", ".join(seeds),
            arguments.developed_on,
            arguments.scored_on,
        ),
        tuple(row for part in parts for row in rows_of(part, len(parts) > 1)),
        notes=tuple(arguments.note),
    )


def rows_of(part: dict[str, Any], several: bool) -> Iterator[KeptRow]:
    """Rows of one part, all of them together, and its false alarms."""
    before = f"{part['source']}, {part['configuration']}: " if several else ""
    for row in part["rows"]:
        times = row["scores"]["detection_time_s"]
        cells = {"detected after, median": f"{times['median']:.2f} s"} if times else {}
        yield KeptRow(before + row["row"], row["right"], row["count"], cells=cells)
    whole = part["scores"]
    yield KeptRow(f"{before}all", whole["right"]["right"], whole["right"]["count"])
    alarms = whole["false_alarms_per_hour"]
    yield KeptRow(f"{before}false alarms", events=alarms["alarms"], hours=alarms["hours"])


def of_bench(summary: dict[str, Any], arguments: argparse.Namespace) -> KeptResult:
    """Figures of a bench; its load and backend describe the machine."""
    figures, left_out = summary["figures"], TIMES if arguments.ratios else ()
    name = summary["name"]
    machine = f"{summary['cores']} cores, load average {summary['load']:.1f}"
    return KeptResult(
        arguments.title,
        name if name.startswith(("scripts/", "bench/")) else f"scripts/bench {name}",
        Origin(
            summary["date"],
            summary["commit"],
            developed_on=arguments.developed_on,
            scored_on=arguments.scored_on,
        ),
        tuple(of_figure(figure) for figure in figures if figure["unit"] not in left_out),
        machine=f"{machine}, {summary['backend']}",
        notes=tuple(arguments.note),
    )


def of_figure(figure: dict[str, Any]) -> KeptRow:
    """One figure as a row."""
    return KeptRow(
        figure["name"],
        value=figure["value"],
        unit=figure["unit"],
        n=str(figure["n"]),
        low=figure["low"],
        high=figure["high"],
        against=figure["against"],
        origin={"seed": figure["seed"]} if figure["seed"] else {},
    )


if __name__ == "__main__":
    sys.exit(main())
