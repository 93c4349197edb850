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

"""``flea realism``: comparison of the simulated stand with recordings of the real one."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError
from flea_diag.formats import stamped
from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import say, write_json

if TYPE_CHECKING:
    from flea_sim_driver.realism.realism import Comparison, Summary

NAME = "realism"
SUMMARY = "compare simulated runs with real recordings of the same motion and load"
EXAMPLES = """\
examples:
  flea realism recordings/*.data                          print a table
  flea realism recordings/*.data --json out.json --plots pictures
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea realism``."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN.data", help="FLEA recordings")
    parser.add_argument("--seed", type=int, default=1, help="seed of the simulated units (1)")
    add_json(parser, "all numbers")
    parser.add_argument(
        "--plots",
        type=Path,
        metavar="DIR",
        help="plot each run and the held-out half (needs matplotlib)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare; 0 when done."""
    from flea_sim_driver.acquisition.recording import NAME as RUN_NAME
    from flea_sim_driver.realism.realism import compare, summaries

    paths = [path for path in arguments.runs if RUN_NAME.match(path.name)]
    if not paths:
        raise ConfigurationError(
            f"realism: none of {len(arguments.runs)} files is a nominal, jam or spall run "
            "(BatchProfile_<motion><n><n>_..._Nominal_Low.data)"
        )
    from flea_diag.tools.stand.realism_pictures import Album

    album = Album(arguments.plots) if arguments.plots else None
    rows = compare(paths, arguments.seed, album.add if album else None)
    table = summaries(rows)
    say(as_text(table))
    if album:
        album.finish()
    if arguments.json:
        _write(arguments.json, rows, table)
    skipped = len(arguments.runs) - len(paths)
    if skipped:
        say(f"{skipped} files of other kinds left out", file=sys.stderr)
    return 0


def as_text(table: list[Summary]) -> str:
    """The summaries as a table; a distance of 0.10 is a deviation of 10 %."""
    lines = []
    previous = ("", "")
    for row in table:
        if (row.half, row.label) != previous:
            previous = (row.half, row.label)
            lines += ["", f"{row.half}, {row.label} ({row.runs} runs)"]
            lines.append(f"  {'statistic':26}{'real':>11}{'simulated':>11}  distance   bias")
        lines.append(
            f"  {row.statistic:26}{row.real:11.4g}{row.simulated:11.4g}  {row.distance:8.2f}"
            f"  {row.bias:+5.2f}  {row.unit}"
        )
    lines += ["", "distance: median over runs of |ln(simulated / real)|; bias: the same with sign."]
    lines.append("The simulator was tuned on the tuning half; the held-out half is the result.")
    return "\n".join(lines).lstrip("\n")


def _write(path: Path, rows: list[Comparison], table: list[Summary]) -> None:
    content = {
        "summaries": [asdict(row) for row in table],
        "runs": [{**asdict(row), "distance": row.distance} for row in rows],
    }
    write_json(path, stamped("realism report", content))
