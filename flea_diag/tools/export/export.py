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

"""``flea export``: a recording, or what a diagnosis says of it, in the format of other programs."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_calibration, add_stand
from flea_diag.tools.terminal import tell

if TYPE_CHECKING:
    from flea_diag.api.diagnosis import Diagnosis
    from flea_diag.api.recording import Recording
    from flea_diag.api.table import Table

NAME = "export"
SUMMARY = "write a recording or its diagnosis as CSV, Parquet, MCAP or a scenario of the DXC"
EXAMPLES = """\
examples:
  flea export bags/jam -o jam.csv                            channels in SI over seconds
  flea export bags/jam -o jam.parquet --what residuals       with z and limits
  flea export bags/jam -o verdicts.csv --what verdicts       one row a change
  flea export bags/jam -o why.csv --what evidence            for and against each fault
  flea export run.csv --stand ./mine -o bags/run             a bag (MCAP) of any recording
  flea export bags/jam -o bags/jam_diagnosed --what diagnosis    a bag with all records of it
  flea export bags/jam -o jam.scn                            scenario of the competitions (DXC)
  flea export bags/jam -o jam.scn --what diagnosis           with what is diagnosed, over time

Exit status: 0 written, 2 refused.
"""
CHANNELS, DIAGNOSIS = "channels", "diagnosis"
TABLES: dict[str, Callable[[Diagnosis], Table]] = {
    "residuals": lambda result: result.residuals,
    "verdicts": lambda result: result.verdicts,
    "evidence": lambda result: result.evidence,
}
"""What may be exported of a diagnosis as a table."""
SCENARIO = ".scn"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "recording", metavar="RECORDING", help="bag, URL, or any recording that the stand describes"
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=Path,
        metavar="OUT",
        help="file ending on .csv, .csv.gz, .parquet or .scn; without an ending: a new bag",
    )
    parser.add_argument(
        "--what",
        default=CHANNELS,
        choices=(CHANNELS, *TABLES, DIAGNOSIS),
        help="what is written (default %(default)s)",
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    add_stand(parser)
    add_calibration(parser)
    add_json(parser, "what was written")


def run(arguments: argparse.Namespace) -> int:
    """Read the recording, diagnose it where that is asked for, write one file or bag."""
    from flea_diag.api.opening import open_recording

    target: Path = arguments.output
    if target.exists() and not (arguments.force and target.is_file()):
        what = "use --force to overwrite it" if target.is_file() else "name a new bag"
        raise ConfigurationError(f"{target} exists: {what}")
    recording = open_recording(arguments.recording, arguments.stand or None)
    rows = _export(recording, arguments)
    told = {"recording": arguments.recording, "output": str(target), "what": arguments.what}
    words = f"{target}: {arguments.what} of {recording.name}, {rows} rows"
    tell(arguments.json, {**told, "rows": rows}, words)
    return 0


def _export(recording: Recording, arguments: argparse.Namespace) -> int:
    """Write what is wanted; number of rows or records."""
    from flea_diag.tools.export.bags import save_diagnosis
    from flea_diag.tools.export.scenario import save_scenario

    target: Path = arguments.output
    what, is_bag = arguments.what, not target.suffix
    if what == DIAGNOSIS and not is_bag and target.suffix != SCENARIO:
        raise ConfigurationError(
            f"--what {DIAGNOSIS} are records of many kinds, {shown(target.name)} holds a table: "
            f"name a bag (without an ending) or a scenario ({SCENARIO}), or choose --what "
            f"{', '.join(TABLES)}"
        )
    if what in TABLES and (is_bag or target.suffix == SCENARIO):
        raise ConfigurationError(
            f"--what {what} is a table: name {target}.csv or {target}.parquet, or choose "
            f"--what {DIAGNOSIS} for a bag"
        )
    if what == DIAGNOSIS and is_bag:
        return save_diagnosis(recording, _stand(recording, arguments), target)
    result = None if what == CHANNELS else _diagnosis(recording, arguments, what in TABLES)
    if result is not None and what in TABLES:
        table = TABLES[what](result)
        table.save(target)
        return table.rows
    if target.suffix == SCENARIO:
        save_scenario(recording, target, result)
    elif is_bag:
        recording.save(target)
    else:
        recording.table.save(target)
    return recording.table.rows


def _diagnosis(recording: Recording, arguments: argparse.Namespace, residuals: bool) -> Diagnosis:
    from flea_diag.api.diagnose import diagnose

    stand, calibration = arguments.stand or None, arguments.calibration
    return diagnose(recording, stand, calibration=calibration, residuals=residuals)


def _stand(recording: Recording, arguments: argparse.Namespace) -> object:
    from flea_diag.tools.stand_option import chosen_stand

    if arguments.stand or recording.stand is None:
        return chosen_stand(arguments, "calibration")
    return recording.stand
