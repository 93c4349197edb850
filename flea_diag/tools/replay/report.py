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

"""``flea report``: the report of a shift from its recording."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import tell, write_text

if TYPE_CHECKING:
    from flea_diag.operator.state import OperatorState
    from flea_diag.wire.records import Record

NAME = "report"
SUMMARY = "write the report of a shift: alarms, what was done, evidence"
EXAMPLES = """\
examples:
  flea report bags/run                      to bags/run_report.html
  flea report bags/run -o shift.html        to another file
  flea report bags/bay_1 bags/bay_2         several stands in one report, to shift_report.html
  flea report bags/run --language de        in German

The report is one page of HTML with its evidence behind it, to be read or printed (PDF: print it
from a browser). It is made of the recorded verdicts and remarks; the page of a running stand has
a button for the same.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bags", type=Path, nargs="+", metavar="BAGDIR", help="recordings")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="HTML",
        help="file (default: BAGDIR_report.html, of several recordings shift_report.html)",
    )  # fmt: skip
    parser.add_argument(
        "--language", "--lang", default="en", metavar="CODE",
        help="language of the report: en, de, or a file of texts (default: %(default)s)",
    )  # fmt: skip
    add_json(parser, "alarms, what was done, and marks")


def run(arguments: argparse.Namespace) -> int:
    """Write the report of one shift, recorded on one stand or on several."""
    from flea_diag import __version__
    from flea_diag.configuration.languages import catalogue
    from flea_diag.operator.shift.shift_report import shift_report
    from flea_diag.operator.words import speak, tr

    speak(*catalogue(arguments.language))
    bags: list[Path] = arguments.bags
    target: Path = arguments.output or _target(bags)
    found = {name: at_the_end(bag) for name, bag in zip(_names(bags), bags, strict=True)}
    made_ns = max(ended_ns for ended_ns, _ in found.values())
    states = {name: state for name, (_, state) in found.items()}
    facts = (*((tr("recording"), str(bag)) for bag in bags), ("flea_diag", __version__))
    write_text(target, shift_report(states, ", ".join(states), made_ns, facts))
    alarms = sum(len(state.alarms) for state in states.values())
    marks = sum(len(state.marks) for state in states.values())
    content = {"report": str(target), "stands": {n: _content(s) for n, s in states.items()}}
    counts = (alarms, "alarm"), (marks, "mark")
    told = ", ".join(f"{count} {what}{'s' * (count != 1)}" for count, what in counts)
    tell(arguments.json, content, f"{target}: {told}")
    return 0


def _content(state: OperatorState) -> dict[str, Any]:
    """Alarms with what was done, and marks, of one stand."""
    from dataclasses import asdict

    rows = {"alarms": state.alarms, "marks": state.marks}
    return {name: [asdict(row) for row in found] for name, found in rows.items()}


def _target(bags: list[Path]) -> Path:
    if len(bags) > 1:
        return Path("shift_report.html")
    return bags[0].with_name(f"{bags[0].name}_report.html")


def _names(bags: list[Path]) -> list[str]:
    """What each recording is called: its name, or its path where another has the same name."""
    names = [bag.name for bag in bags]
    return [b.name if names.count(b.name) == 1 else str(b) for b in bags]


def at_the_end(bag: Path) -> tuple[int, OperatorState]:
    """Latest stamp of a recording, and the state of its stand then."""
    from flea_diag.operator.journal_state import as_of
    from flea_diag.operator.state import SHOWN
    from flea_diag.wire.bags.bag import read_bag
    from flea_diag.wire.records import Remark, Scan

    kinds = tuple(kind for kind in (*SHOWN, Remark) if kind is not Scan)
    records = [record for _, record in read_bag(bag, kinds)]
    ended_ns = max((record.stamp_ns for record in records), default=0)
    return ended_ns, as_of(shift(records), ended_ns)


def shift(records: Iterable[Record]) -> OperatorState:
    """State at the end of the shift that these records tell of."""
    from flea_diag.operator.journal_state import with_remark
    from flea_diag.operator.state import OperatorState, fold
    from flea_diag.wire.records import Remark

    state = OperatorState()
    for record in records:
        if isinstance(record, Remark):
            state = with_remark(state, record)
        else:
            state = fold(state, record, record.stamp_ns)
    return state
