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

"""Keeps what two configurations make of the same runs, for docs/results.

python bench/results/pairs.py EVALUATION... --of evidence --as evidence \
    --title "..." --scored-on "..."

Each EVALUATION is a folder of `flea evaluate` whose campaign names both. Rows in which the two
differ stand below those of all runs of a source; what both decide alike is counted, not listed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from kept import FOLDER, KeptResult, KeptRow, Origin, write_kept

from flea_diag.tools.campaign.result_log import RESULTS, read_results
from flea_diag.tools.campaign.run_result import RunResult

Pair = tuple[RunResult, RunResult]


def main() -> int:
    """Pair and write; 2 where there is nothing to pair."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path, metavar="EVALUATION")
    parser.add_argument("--of", required=True, help="configuration that the rows are of")
    parser.add_argument("--against", default="hybrid", help="the other one")
    parser.add_argument("--as", dest="name", required=True, help="name of the kept file")
    parser.add_argument("--title", required=True, help="heading of its table")
    parser.add_argument("--developed-on", default="", help="runs that the method was tuned on")
    parser.add_argument("--scored-on", required=True, help="runs behind the figures")
    parser.add_argument("--note", action="append", default=[], help="a sentence above the table")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="default: docs/results/kept")
    given = parser.parse_args()
    found = {folder: paired(folder, given.of, given.against) for folder in given.folders}
    empty = [str(folder) for folder, pairs in found.items() if not pairs]
    if empty:
        print(f"pairs: no runs by both in {', '.join(empty)}", file=sys.stderr)
        return 2
    runs = [run for pairs in found.values() for pair in pairs for run in pair]
    origin = Origin(
        max(run.date for run in runs),
        ", ".join(sorted({run.commit for run in runs})),
        developed_on=given.developed_on,
        scored_on=given.scored_on,
    )
    rows = tuple(row for folder, pairs in found.items() for row in rows_of(pairs, folder.name))
    notes = tuple(given.note)
    made_by = "bench/results/pairs.py"
    write_kept(
        given.folder / f"{given.name}.json",
        KeptResult(given.title, made_by, origin, rows, notes=notes),
    )
    return 0


def paired(folder: Path, of: str, against: str) -> list[Pair]:
    """Runs that both have diagnosed."""
    results = [run for run in read_results(folder / RESULTS) if not run.failure]
    other = {(run.id, run.fold): run for run in results if run.configuration == against}
    ours = [run for run in results if run.configuration == of]
    return [(run, other[run.id, run.fold]) for run in ours if (run.id, run.fold) in other]


def rows_of(pairs: Sequence[Pair], campaign: str) -> Iterator[KeptRow]:
    """All runs of each source, its false alarms, and rows in which the two differ."""
    for source in dict.fromkeys(run.id.split("/")[0] for run, _ in pairs):
        own = [pair for pair in pairs if pair[0].id.split("/")[0] == source]
        name = source if source == campaign else f"{campaign}, {source}"
        yield row_of(f"{name}: all", own)
        hours = sum(run.nominal_s for run, _ in own) / 3600.0
        alarms, others = (sum(pair[k].false_alarms for pair in own) for k in (0, 1))
        cells = {"the other": f"{others}"}
        yield KeptRow(f"{name}: false alarms", events=alarms, hours=round(hours, 3), cells=cells)
        quiet = [p for p in own if not any(run.alarms_s for run in p)]
        if quiet:
            yield cost(f"{name}: CPU for 1 s without an alarm", quiet)
        loud = [p for p in own if all(run.alarms_s for run in p)]
        if loud:
            yield cost(f"{name}: CPU for 1 s, runs with an alarm", loud)
        for row in dict.fromkeys(run.row for run, _ in own):
            part = [pair for pair in own if pair[0].row == row]
            if any(ours.right != theirs.right for ours, theirs in part):
                yield row_of(f"{name}: {row}", part)


def row_of(name: str, pairs: Sequence[Pair]) -> KeptRow:
    """Right of both, right of one alone, and medians of what both have detected."""
    right, theirs = (sum(pair[k].right for pair in pairs) for k in (0, 1))
    alone = sum(ours.right and not other.right for ours, other in pairs)
    both = [p for p in pairs if all(run.detection_time_s is not None for run in p)]
    wrong = [sum(pair[k].misnamed for pair in pairs) for k in (0, 1)]
    cells = {
        "the other": f"{theirs}",
        "a wrong fault isolated": f"{wrong[0]}, {wrong[1]}",
        "right alone, other alone": f"{alone}, {theirs - right + alone}",
        "detected after": medians(both, lambda run: run.detection_time_s or 0.0, "s"),
        "faults in the group": means(both, lambda run: len(run.group)),
    }
    return KeptRow(name, right, len(pairs), cells={k: v for k, v in cells.items() if v})


def cost(name: str, pairs: Sequence[Pair]) -> KeptRow:
    """Median processor time of the diagnosis alone for one second of data."""
    times = [[1e3 * pair[k].cpu_s / pair[k].duration_s for pair in pairs] for k in (0, 1)]
    value, other = (round(float(np.median(each)), 2) for each in times)
    return KeptRow(name, value=value, unit="ms", n=str(len(pairs)), cells={"the other": f"{other}"})


def medians(pairs: Sequence[Pair], of: Callable[[RunResult], float], unit: str) -> str:
    """Both medians; empty without a pair."""
    if not pairs:
        return ""
    ours, theirs = (float(np.median([of(pair[k]) for pair in pairs])) for k in (0, 1))
    return f"{ours:.2f}, {theirs:.2f} {unit}"


def means(pairs: Sequence[Pair], of: Callable[[RunResult], float]) -> str:
    """Both means; empty without a pair."""
    if not pairs:
        return ""
    ours, theirs = (float(np.mean([of(pair[k]) for pair in pairs])) for k in (0, 1))
    return f"{ours:.2f}, {theirs:.2f}"


if __name__ == "__main__":
    sys.exit(main())
