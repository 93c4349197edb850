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

"""``flea bag check``: checks the rosbag2 layout and every message of bags."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from flea_diag.errors import FleaError
from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_stand, chosen_stand
from flea_diag.tools.terminal import IN_PART, progress, say, warn, write_json

NAME = "bag"
SUMMARY = "check the integrity of bags (flea bag check BAGDIR...)"
EXAMPLES = """\
examples:
  flea bag check bags/*                     exit status 1 if any bag has an error
  flea bag check mine/* --stand ./mine      units as its description states them
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    check_parser = actions.add_parser("check", help="check layout, metadata and every message")
    check_parser.add_argument("bags", nargs="+", type=Path, metavar="BAGDIR", help="bags to check")
    add_stand(check_parser)
    add_json(check_parser, "the findings")


def run(arguments: argparse.Namespace) -> int:
    """Check every bag."""
    from flea_diag.tools.bags.findings import BagFinding, check

    bad, units = 0, _units(arguments)
    told: list[dict[str, object]] = []
    for number, bag in enumerate(arguments.bags, 1):
        progress(number, len(arguments.bags), bag.name)
        try:
            findings = check(bag, units)
        except FleaError as error:
            findings = [BagFinding(True, str(error))]
        bad += any(finding.error for finding in findings)
        told.append({"bag": str(bag), "findings": [finding._asdict() for finding in findings]})
        if arguments.json == "-":
            continue
        for finding in findings:
            say(f"{bag}: {'error' if finding.error else 'note'}: {finding.words}")
        if not findings:
            say(f"{bag}: sound")
    if arguments.json:
        write_json(arguments.json, told)
    if bad and len(arguments.bags) > 1:
        warn(f"{bad} of {len(arguments.bags)} bags have errors")
    return IN_PART if bad else 0


def _units(arguments: argparse.Namespace) -> Mapping[str, str]:
    """Unit of each channel: standard ones, and those of the stand that is named."""
    from flea_diag.core.residuals.channel_units import UNITS

    if not arguments.stand:
        return UNITS
    from flea_diag.configuration.description import described

    return {**UNITS, **described(chosen_stand(arguments).actuator).units}
