"""``flea report``: the report of a shift from its recording."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.tools.terminal import say, write_text

if TYPE_CHECKING:
    from flea_diag.operator.state import OperatorState
    from flea_diag.wire.records import Record

NAME = "report"
SUMMARY = "write the report of a shift: alarms, what was done, evidence"
EXAMPLES = """\
examples:
  flea report bags/run                      to bags/run_report.html
  flea report bags/run -o shift.html        to another file

The report is one page of HTML with its evidence behind it, to be read or printed (PDF: print it
from a browser). It is made of the recorded verdicts and remarks; the page of a running stand has
a button for the same.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bag", type=Path, metavar="BAGDIR", help="recording")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="HTML", help="file (default: BAGDIR_report.html)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the report of one bag."""
    from flea_diag import __version__
    from flea_diag.operator.journal_state import as_of
    from flea_diag.operator.shift_report import shift_report
    from flea_diag.operator.state import SHOWN
    from flea_diag.wire.bags.bag import read_bag
    from flea_diag.wire.records import Remark, Scan

    source: Path = arguments.bag
    target: Path = arguments.output or source.with_name(f"{source.name}_report.html")
    kinds = tuple(kind for kind in (*SHOWN, Remark) if kind is not Scan)
    records = [record for _, record in read_bag(source, kinds)]
    made_ns = max((record.stamp_ns for record in records), default=0)
    state = as_of(shift(records), made_ns)
    facts = (("recording", str(source)), ("flea_diag", __version__))
    write_text(target, shift_report(state, source.name, made_ns, facts))
    say(f"{target}: {len(state.alarms)} alarms, {len(state.marks)} marks")
    return 0


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
