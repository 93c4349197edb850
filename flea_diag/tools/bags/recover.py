"""``flea recover``: copies a truncated bag to a new one with summary, index and metadata."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import IN_PART, say, warn, write_json

NAME = "recover"
SUMMARY = "copy a truncated bag to a new one with summary, index and metadata.yaml"
EXAMPLES = """\
examples:
  flea recover bags/run                    to bags/run_recovered; bags/run is not changed
  flea recover bags/run -o bags/whole
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bag", type=Path, metavar="BAGDIR", help="truncated bag, or one .mcap file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="BAGDIR", help="new bag (default: BAGDIR_recovered)"
    )
    add_json(parser, "what was recovered and lost")


def run(arguments: argparse.Namespace) -> int:
    """Recover one bag."""
    from flea_diag.tools.bags.recovery import recover

    source: Path = arguments.bag
    target = arguments.output or source.with_name(f"{source.stem}_recovered")
    recovered = recover(source, target)
    for loss in recovered.losses:
        warn(loss)
    if arguments.json:
        write_json(arguments.json, {"bag": str(target), **asdict(recovered)})
    if arguments.json != "-":
        say(f"{target}: {recovered.messages} messages on {recovered.topics} topics")
    return IN_PART if any("no footer" not in loss for loss in recovered.losses) else 0
