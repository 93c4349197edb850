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

"""``flea recover``: copies a truncated bag to a new one with summary, index and metadata."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import IN_PART, tell, warn

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
    words = f"{target}: {recovered.messages} messages on {recovered.topics} topics"
    tell(arguments.json, {"bag": str(target), **asdict(recovered)}, words)
    return IN_PART if any("no footer" not in loss for loss in recovered.losses) else 0
