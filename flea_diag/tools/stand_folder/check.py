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

"""``flea stand check``: what the recordings of a stand are good for, on one page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import FleaError, RecordingError
from flea_diag.tools.argument import add_json
from flea_diag.tools.terminal import IN_PART, progress, tell, warn

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.tools.stand_check.recorded_motion import RecordedMotion

SUMMARY = "say what recordings of a stand are good for: channels, faults and sizes, what is missing"
MOST_APART = 0.01
"""Share by which the scan periods of two recordings of one stand may differ."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "folder", metavar="DIR", help="folder of the stand, or name of a shipped one"
    )
    parser.add_argument(
        "recordings",
        nargs="+",
        type=Path,
        metavar="RECORDING",
        help="healthy runs: bags, or files that its channels.yaml describes",
    )
    add_json(parser, "the page")


def run(arguments: argparse.Namespace) -> int:
    """Print the page; 0: all usable, 1: a recording or a channel is not."""
    from flea_diag.configuration.acceptance import require_accepted
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.stand_check.page_text import as_mapping, as_text
    from flea_diag.tools.stand_check.stand_page import stand_page

    stand = load_stand(arguments.folder)
    require_accepted(stand)
    motions, refused = _read(arguments.recordings, stand)
    page = stand_page(stand, motions)
    tell(arguments.json, as_mapping(page), as_text(page))
    for words in (*page.problems, *page.modes):
        warn(words)
    return IN_PART if refused or page.problems else 0


def _read(paths: list[Path], stand: Stand) -> tuple[list[RecordedMotion], int]:
    """Recordings of one rate, and how many files were refused.

    Raises
    ------
    RecordingError
        None is usable.
    """
    from flea_diag.tools.stand_check.recorded_motion import recorded_motions

    found: list[RecordedMotion] = []
    refused = 0
    for number, path in enumerate(paths, 1):
        progress(number, len(paths), path.name)
        try:
            for motion in recorded_motions(path, stand):
                _check_alike(motion, found)
                found.append(motion)
        except FleaError as error:
            refused += 1
            warn(str(error))
    if not found:
        raise RecordingError(f"none of {len(paths)} recordings can be used")
    return found, refused


def _check_alike(motion: RecordedMotion, others: list[RecordedMotion]) -> None:
    if not others or abs(motion.period_s - others[0].period_s) <= MOST_APART * others[0].period_s:
        return
    raise RecordingError(
        f"{motion.name}: scans every {motion.period_s:g} s, {others[0].name} every "
        f"{others[0].period_s:g} s: check recordings of one stand and rate"
    )
