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

"""``flea features``: list of features, their cost, and tables learned from runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from flea_diag.tools.argument import add_json, count, positive, share
from flea_diag.tools.planned_runs import add_option
from flea_diag.tools.stand_option import add_stand

NAME = "features"
SUMMARY = "list and measure vibration features; learn, score and show fault feature tables"
EXAMPLES = """\
examples:
  flea features list                                    list ids, units, costs and meanings
  flea features learn bags/* -o feature_table.yaml      learn a table from labelled bags
  flea features judge feature_table.yaml --seeds 0:20   score a table on simulated runs
  flea features tree feature_table.yaml jam spall       show the diagnosis tree of a group
  flea features train bags/* -o classifier.json         train the feature-only classifier
  flea features study --seeds 0:20 --draw sizes.svg     accuracy of the diagnosis by fault size
"""

STRATEGIES = "paper, balanced, information or optimal"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea features``."""
    commands = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    listed = commands.add_parser("list", help="list ids, units, relative costs and meanings")
    add_json(listed, "the list")
    measured = commands.add_parser("bench", help="measure each feature's CPU time, 1 s at 20 kHz")
    add_json(measured, "the times in seconds")
    _learn_arguments(commands.add_parser("learn", help="learn a table from labelled bags"))
    _judge_arguments(commands.add_parser("judge", help="score a table on runs not learned from"))
    tree = commands.add_parser("tree", help="print the diagnosis tree of a table")
    tree.add_argument("table", help="fault feature table, YAML")
    tree.add_argument("faults", nargs="*", help="initial group (default: all faults of the table)")
    tree.add_argument(
        "--strategy", default="optimal", help=f"choice of features: {STRATEGIES} (%(default)s)"
    )
    tree.add_argument(
        "--rarest", type=float, default=0.005, help="least probability of a branch (%(default)s)"
    )
    tree.add_argument("--draw", type=Path, metavar="OUT", help="draw the tree: .svg, .png or .pdf")
    add_json(tree, "the tree")
    train = commands.add_parser("train", help="train the feature-only classifier on labelled bags")
    _run_arguments(train)
    add_stand(train)
    train.add_argument("-o", "--output", type=Path, required=True, help="JSON file to write")
    add_json(train, "features and classes")
    _study_arguments(commands.add_parser("study", help="score the diagnosis on simulated runs"))
    found = commands.add_parser("bearing", help="test features on bearing recordings")
    found.add_argument("normal", type=Path, help="MATLAB file of a healthy bearing")
    found.add_argument("faulty", type=Path, nargs="+", help="MATLAB files of faulty bearings")
    found.add_argument(
        "--rate", type=positive, default=48_000.0, metavar="HZ", help="sampling rate (%(default)s)"
    )
    found.add_argument(
        "--rpm", type=positive, default=1797.0, help="shaft speed, 1/min (%(default)s)"
    )
    found.add_argument(
        "--window", type=positive, default=0.1, metavar="S", help="window length (%(default)s)"
    )
    found.add_argument(
        "--false-alarm-rate",
        type=share,
        default=0.01,
        help="share of nominal windows outside the range of a feature (%(default)s)",
    )
    add_json(found, "false alarms and detections of each feature")


def _learn_arguments(parser: argparse.ArgumentParser) -> None:
    _run_arguments(parser)
    add_stand(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, help="table to write")
    parser.add_argument(
        "--false-alarm-rate",
        type=share,
        default=0.01,
        help="share of nominal windows outside the range of a feature (%(default)s)",
    )
    parser.add_argument(
        "--most", type=count, default=18, help="largest number of features (%(default)s)"
    )
    parser.add_argument("--title", default="learned fault feature table", help="title of the table")
    add_json(parser, "the ranking of the features")


def _study_arguments(parser: argparse.ArgumentParser) -> None:
    add_stand(parser)
    parser.add_argument("--seeds", metavar="FIRST:LAST", required=True, help="seeds of the runs")
    parser.add_argument(
        "--faults",
        default="spall,jam,ball_nut_friction,accelerometer_2_fault",
        help="faults to simulate, comma-separated (%(default)s)",
    )
    parser.add_argument("--table", help="fault feature table (default: that of the stand)")
    parser.add_argument("--jobs", type=count, default=1, help="parallel processes (%(default)s)")
    parser.add_argument(
        "--classifier", type=Path, metavar="FILE", help="compare with this classifier"
    )
    add_json(parser, "one row per run, after each run,")
    add_option(parser)
    parser.add_argument("--draw", type=Path, metavar="OUT", help="plot accuracy against fault size")


def _judge_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("table", help="fault feature table, YAML")
    _run_arguments(parser)
    parser.add_argument(
        "--windows", type=count, default=1, help="windows available per run (%(default)s)"
    )
    parser.add_argument("--pairs", action="store_true", help="also score every pair of the group")
    parser.add_argument(
        "--classifier", type=Path, metavar="FILE", help="score this classifier on the same windows"
    )
    parser.add_argument(
        "--group", default="", help="initial group, comma-separated (default: all faults)"
    )
    parser.add_argument(
        "--strategy", default="optimal", help=f"choice of features: {STRATEGIES} (%(default)s)"
    )
    add_json(parser, "the walk of each run")


def _run_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bags", nargs="*", type=Path, help="bags with truth")
    parser.add_argument(
        "--seeds",
        metavar="FIRST:LAST",
        help="simulate runs with these seeds (LAST excluded) instead",
    )
    parser.add_argument(
        "--loads",
        metavar="LOW:HIGH",
        default="0:300",
        help="load of simulated runs, N (%(default)s)",
    )
    parser.add_argument(
        "--duration",
        type=positive,
        default=6.5,
        metavar="S",
        help="duration of simulated runs, s (%(default)s)",
    )
    parser.add_argument("--jobs", type=count, default=1, help="parallel processes (%(default)s)")
    parser.add_argument(
        "--window", type=positive, default=1.0, metavar="S", help="window length (%(default)s)"
    )
    parser.add_argument(
        "--hop", type=positive, default=1.0, metavar="S", help="window spacing (%(default)s)"
    )
    add_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run one action; return 0 on success."""
    from flea_diag.tools.features.actions import ACTIONS

    action = ACTIONS[arguments.action]
    return int(action(arguments))
