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

"""``flea calibrate``: identifies parameters, offsets and limits from nominal recordings."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.core.calibration.promise import FALSE_ALARMS_PER_HOUR
from flea_diag.errors import CalibrationError, ConfigurationError
from flea_diag.tools.argument import add_cluster, add_jobs, add_json
from flea_diag.tools.bag_url import bag_place
from flea_diag.tools.calibrate import report as calibration_report
from flea_diag.tools.calibrate.nominal_recording import read_nominal
from flea_diag.tools.calibrate.recording_checks import (
    check_bands,
    check_modes,
    check_signs,
    lag_words,
)
from flea_diag.tools.calibrate.shared_work import Sharing
from flea_diag.tools.extra import require
from flea_diag.tools.stand_option import absolute, accepted_stand, add_stand
from flea_diag.tools.terminal import IN_PART, make_folder, say, tell, warn, write_text
from flea_diag.tools.workers import KeptPool

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.tools.calibrate.nominal_recording import NominalRecording
    from flea_diag.tools.calibrate.procedure import CalibrationResult

NAME = "calibrate"
SUMMARY = "identify parameters and limits from nominal bags"
EXAMPLES = """\
examples:
  flea calibrate bags/*Nominal* -o calibration.yaml
  flea calibrate bags/nominal_* -o calibration.yaml --false-alarms 0.01
  flea calibrate bags/nominal_* --stand ./mine -o mine/calibration.yaml
  flea calibrate runs/*.csv --stand ./mine -o mine/calibration.yaml     raw, without an import
  flea calibrate bags/nominal_* -o calibration.yaml --plots pictures/
  flea calibrate bags/nominal_* -o calibration.yaml --law-only    an older calibration
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "bags",
        nargs="+",
        type=bag_place,
        metavar="BAG",
        help="nominal recordings of one stand, 2 or more: bags, their URLs (needs the extra url), "
        "or raw files that its channels.yaml describes",
    )
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE", help="calibration to write"
    )
    parser.add_argument(
        "--false-alarms",
        type=float,
        default=FALSE_ALARMS_PER_HOUR,
        metavar="RATE",
        help="false alarms per hour of nominal operation, all tests together (default %(default)s)",
    )
    parser.add_argument(
        "--plots",
        type=Path,
        metavar="DIR",
        help="plot the residuals of each recording with their limits to DIR (needs matplotlib)",
    )
    parser.add_argument(
        "--plot-format", choices=("png", "svg"), default="png", help="format of the plots"
    )
    add_stand(parser)
    add_jobs(parser)
    add_cluster(parser)
    parser.add_argument(
        "--actuator", metavar="FILE", help="actuator description (default: that of the stand)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    parser.add_argument(
        "--law-only",
        action="store_true",
        help="learn the law of healthy recordings alone, into FILE: its parameters and limits stay",
    )
    add_json(parser, "the calibration")


def run(arguments: argparse.Namespace) -> int:
    """Read the bags, calibrate, write the file and print the report."""
    _check(arguments)
    from numpy.linalg import LinAlgError

    from flea_diag.configuration.description import compiled_relations
    from flea_diag.tools.calibrate.procedure import learn
    from flea_diag.tools.recordings.raw_recordings import as_bags

    stand = accepted_stand(arguments, "actuator")
    known = compiled_relations(stand.actuator).residuals
    used = absolute(stand) if arguments.dask else stand
    with as_bags(arguments.bags, stand) as bags, KeptPool(arguments.jobs) as pool:
        sharing = Sharing(arguments.jobs, arguments.dask, pool)
        recordings, refused = read_nominal(bags.places, known, sharing)
        check_signs(recordings, known)
        check_bands(recordings, known)
        for words in (*check_modes(recordings, known), *lag_words(recordings, known)):
            warn(words)
        try:
            if arguments.law_only:
                return _only_law(arguments.output, used, recordings, sharing)
            found = learn(
                recordings, used.actuator, arguments.false_alarms, sharing, faults=used.faults
            )
        except (ArithmeticError, LinAlgError) as error:
            raise CalibrationError(
                f"the parameters that these recordings show lead to numbers beyond any ({error}): "
                "hold their channels, units and signs against each other with flea stand check"
            ) from error
    calibration = found.calibration
    for row in calibration.left_out:
        warn(f"{row.recording}: left out: {row.reason}")
    for name, reason in found.unlike.items():
        warn(f"{name}: unlike the others, so the law is learned without it: {reason}")
    for words in found.noisy:
        warn(words)
    if found.alike:
        warn(
            f"serial numbers {', '.join(found.alike)}: their recordings differ by less than "
            "healthy units do: counted as one unit, tolerances are those of the description"
        )
    refused += [*bags.refused, *(row.recording for row in calibration.left_out)]
    write_calibration(arguments.output, calibration)
    if arguments.plots is not None:
        _draw(found, arguments.plots, arguments.plot_format)
    words = calibration_report.words(calibration, found.relations)
    tell(arguments.json, calibration.to_mapping(), words)
    if refused:
        warn(f"{len(refused)} of {len(arguments.bags)} bags not used")
    return IN_PART if refused else 0


def _check(arguments: argparse.Namespace) -> None:
    """Refuse options that cannot be."""
    if not arguments.false_alarms > 0.0:
        raise ConfigurationError(
            f"--false-alarms = {arguments.false_alarms} must be above 0 per hour"
        )
    if arguments.law_only and not arguments.output.exists():
        raise ConfigurationError(
            f"--law-only: {arguments.output} does not exist: give the calibration that lacks a "
            "law, or calibrate without --law-only"
        )
    if arguments.output.exists() and not (arguments.force or arguments.law_only):
        raise ConfigurationError(f"{arguments.output} exists: use --force to overwrite it")
    if arguments.plots is not None:
        require("plot", "--plots")


def _only_law(
    path: Path, stand: Stand, recordings: list[NominalRecording], sharing: Sharing
) -> int:
    """Learn the law into a calibration of this stand."""
    from flea_diag.configuration.calibrations import learned
    from flea_diag.configuration.description import described
    from flea_diag.tools.calibrate.law import LawOfRecordings
    from flea_diag.tools.calibrate.recording_checks import check_recordings

    check_recordings(recordings, described(stand.actuator), stand.actuator)
    calibration = learned(replace(stand, calibration=path.absolute()))
    law = LawOfRecordings.of(calibration, stand.actuator, stand.faults, recordings, sharing)
    for name, reason in law.unlike.items():
        warn(f"{name}: unlike the others, so the law is learned without it: {reason}")
    for words in law.noisy:
        warn(words)
    seeing = law.seeing(calibration, recordings, sharing)
    write_calibration(path, replace(calibration, law=seeing))
    say(f"{path}: law of {len(recordings) - len(law.unlike)} recordings")
    return IN_PART if law.unlike else 0


def _draw(found: CalibrationResult, folder: Path, kind: str) -> None:
    """One picture of each recording, and one of the envelope where there is one."""
    from flea_diag.tools.calibrate import envelope_picture, plots

    plots.draw(found.calibration, found.traces, folder, kind)
    if found.calibration.envelope is not None:
        envelope_picture.draw_envelope(
            found.calibration, found.traces, found.relations, folder, kind
        )


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write a calibration file; its folder is created if missing.

    Raises
    ------
    CalibrationError
        No other command would read it: a number is out of its range.
    ConfigurationError
        The file cannot be written.
    """
    import yaml

    from flea_diag.core.calibration.calibration_reader import from_mapping

    content = calibration.to_mapping()
    try:
        from_mapping(content, "the recordings give a calibration that no command takes")
    except CalibrationError as error:
        raise CalibrationError(
            f"{error}: nothing is written; correct the values of the description, or record motion "
            "under loads that show them"
        ) from None
    make_folder(path.parent)
    write_text(path, yaml.safe_dump(content, sort_keys=False, width=100))
