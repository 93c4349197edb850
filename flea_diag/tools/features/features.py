"""``flea features``: what the features are, what they cost, and tables learned from runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from flea_diag.tools.argument import count, positive, share

NAME = "features"
SUMMARY = "list, measure and learn vibration features and the fault feature table"
EXAMPLES = """\
examples:
  flea features list                                    names, units, costs, meanings
  flea features learn bags/* -o feature_table.yaml      a table from labelled bags
  flea features judge feature_table.yaml --stand 0:20   its score on simulated runs
  flea features tree feature_table.yaml jam spall       the tree for a group
  flea features train bags/* -o classifier.json         the feature-only alternative
  flea features study --stand 0:20 --draw sizes.svg     the whole diagnosis against fault size
"""

STRATEGIES = "paper, balanced, information or optimal"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``flea features``."""
    commands = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    commands.add_parser("list", help="names, units, relative costs, meanings")
    commands.add_parser("bench", help="measure each feature on 1 s x 6 axes at 20 kHz")
    _learn_arguments(commands.add_parser("learn", help="learn a table from labelled bags"))
    _judge_arguments(commands.add_parser("judge", help="walk a table on other runs and score it"))
    tree = commands.add_parser("tree", help="print the diagnosis tree of a table")
    tree.add_argument("table", type=Path, help="YAML file")
    tree.add_argument("faults", nargs="*", help="group to start from (all rows)")
    tree.add_argument(
        "--strategy", default="optimal", help="paper, balanced, information or optimal"
    )
    tree.add_argument("--rarest", type=float, default=0.005, help="leave rarer branches out")
    tree.add_argument("--draw", type=Path, metavar="OUT", help="picture too: .svg, .png or .pdf")
    train = commands.add_parser("train", help="train the feature-only classifier on labelled bags")
    _run_arguments(train)
    train.add_argument("-o", "--output", type=Path, required=True, help="JSON file to write")
    _study_arguments(commands.add_parser("study", help="the whole diagnosis on simulated runs"))
    found = commands.add_parser("bearing", help="thresholds and detections on bearing recordings")
    found.add_argument("normal", type=Path, help="MATLAB file of a healthy bearing")
    found.add_argument("faulty", type=Path, nargs="+", help="MATLAB files of faults")
    found.add_argument("--rate", type=positive, default=48_000.0, metavar="HZ")
    found.add_argument("--rpm", type=positive, default=1797.0)
    found.add_argument("--window", type=positive, default=0.1, metavar="S")
    found.add_argument("--false-alarm-rate", type=share, default=0.01)


def _learn_arguments(parser: argparse.ArgumentParser) -> None:
    _run_arguments(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, help="table to write")
    parser.add_argument("--false-alarm-rate", type=share, default=0.01, help="of each feature")
    parser.add_argument("--most", type=count, default=18, help="features in the table")
    parser.add_argument("--title", default="learned fault feature table")


def _study_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--stand", metavar="FIRST:LAST", required=True, help="seeds of the runs")
    parser.add_argument(
        "--faults",
        default="spall,jam,ball_nut_friction,accelerometer_2_fault",
        help="faults to try, by comma (%(default)s)",
    )
    parser.add_argument("--table", default="feature_table.yaml", help="to choose and cost by")
    parser.add_argument("--jobs", type=count, default=1, help="processes that simulate")
    parser.add_argument(
        "--classifier", type=Path, metavar="FILE", help="what this one calls the same runs"
    )
    parser.add_argument(
        "--json", type=Path, metavar="OUT", help="one row a run, written after each"
    )
    parser.add_argument("--draw", type=Path, metavar="OUT", help="accuracy against fault size")


def _judge_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("table", type=Path, help="YAML file")
    _run_arguments(parser)
    parser.add_argument("--windows", type=count, default=1, help="windows that a walk may use")
    parser.add_argument("--pairs", action="store_true", help="every pair of the group as well")
    parser.add_argument(
        "--classifier", type=Path, metavar="FILE", help="score this classifier on the same windows"
    )
    parser.add_argument("--group", default="", help="faults, by comma, to start from (all rows)")
    parser.add_argument(
        "--strategy", default="optimal", help="paper, balanced, information or optimal"
    )


def _run_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bags", nargs="*", type=Path, help="bags with their truth")
    parser.add_argument(
        "--stand", metavar="FIRST:LAST", help="simulate runs with these seeds instead of bags"
    )
    parser.add_argument(
        "--loads", metavar="LOW:HIGH", default="0:300", help="load of such runs, N (%(default)s)"
    )
    parser.add_argument("--duration", type=positive, default=6.5, metavar="S", help="of such a run")
    parser.add_argument("--jobs", type=count, default=1, help="processes that simulate")
    parser.add_argument("--window", type=positive, default=1.0, metavar="S")
    parser.add_argument("--hop", type=positive, default=1.0, metavar="S")


def run(arguments: argparse.Namespace) -> int:
    """Do what was asked for; 0 when all of it could be done."""
    from flea_diag.tools.features.actions import ACTIONS

    action = ACTIONS[arguments.action]
    return int(action(arguments))
