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

"""``flea diff``: decisions that changed between two evaluations or replays, when and why."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.formats import stamped
from flea_diag.tools.argument import add_json

if TYPE_CHECKING:
    from flea_diag.tools.score.decision import Decision

NAME = "diff"
SUMMARY = "list the decisions that changed between two evaluations or two replays, and why"
EXAMPLES = """\
examples:
  flea diff results/before results/after        folders of flea evaluate
  flea diff before.json after.json              files of flea replay --json
  flea diff before after --json changes.json

Exit status: 0 all decisions equal, 1 a decision changed, 2 refused.
"""
CHANGED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    what = "folder of flea evaluate, or JSON file of flea replay"
    parser.add_argument("a", type=Path, metavar="A", help=what)
    parser.add_argument("b", type=Path, metavar="B", help="the same, later")
    add_json(parser, "the changes")
    parser.add_argument("-q", "--quiet", action="store_true", help="exit status only")


def run(arguments: argparse.Namespace) -> int:
    """Compare; 0 if equal, 1 if changed."""
    from flea_diag.tools.score.decision import read_decisions
    from flea_diag.tools.terminal import say, write_json

    report = compare(read_decisions(arguments.a), read_decisions(arguments.b))
    if arguments.json:
        write_json(arguments.json, report)
    if not arguments.quiet and arguments.json != "-":
        say(words(report))
    return CHANGED if report["changed"] or report["only_a"] or report["only_b"] else 0


def compare(a: dict[str, Decision], b: dict[str, Decision]) -> dict[str, Any]:
    """Runs whose decision changed, and runs that are in one of the two only."""
    from flea_diag.tools.score.decision import differences

    both = [name for name in a if name in b]
    # Digests of two backends differ in the last bits.
    alike = [
        name
        for name in both
        if a[name].verdict == b[name].verdict and a[name].backend == b[name].backend
    ]
    changed = [
        {
            "run": name,
            "right": [a[name].right, b[name].right],
            "differences": differences(a[name], b[name]),
        }
        for name in both
        if a[name].verdict != b[name].verdict
    ]
    report = {
        "compared": len(both),
        "changed": changed,
        "only_a": sorted(set(a) - set(b)),
        "only_b": sorted(set(b) - set(a)),
        "other_digest": [name for name in alike if not a[name].same_numbers(b[name])],
        "other_words": [
            name
            for name in alike
            if a[name].same_numbers(b[name]) and a[name].digest != b[name].digest
        ],
    }
    return stamped("comparison", report)


_BETTER = {(False, True): " (now right)", (True, False): " (NO LONGER RIGHT)"}


def words(report: dict[str, Any]) -> str:
    """The comparison as lines, changes first."""
    lines = []
    for change in report["changed"]:
        lines.append(f"{change['run']}{_BETTER.get(tuple(change['right']), '')}")
        lines += [f"    {line}" for line in change["differences"]]
    lines += [f"{name}: only in A" for name in report["only_a"]]
    lines += [f"{name}: only in B" for name in report["only_b"]]
    lost = sum(1 for change in report["changed"] if change["right"] == [True, False])
    won = sum(1 for change in report["changed"] if change["right"] == [False, True])
    lines.append(
        f"{report['compared']} runs compared, {len(report['changed'])} decided otherwise "
        f"({won} now right, {lost} no longer), {len(report['other_digest'])} decided alike by "
        f"other numbers, {len(report['other_words'])} said in other words"
    )
    return "\n".join(lines)
