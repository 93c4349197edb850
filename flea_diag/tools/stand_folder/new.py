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

"""``flea stand new``: writes the folder of a stand from one of its recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError, FleaError
from flea_diag.tools.argument import add_json, positive
from flea_diag.tools.terminal import IN_PART, tell, warn, writing
from flea_diag.wire.whole_file import new_folder

if TYPE_CHECKING:
    from flea_diag.tools.stand_folder.channel_choice import GivenChannel

SUMMARY = "write the folder of a stand from one of its recordings, every guess marked"
FLEA_SUFFIX = ".data"
FLEA_TEXT = """\
# The recordings are text files of the FLEA, whose columns, units and signs are known.
schema_version: 1
format: flea_text
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="folder to write, new or empty")
    add(
        "--from",
        dest="recording",
        type=Path,
        required=True,
        metavar="RECORDING",
        help="table (CSV, TSV, XLSX, NPZ, Parquet, MAT, HDF5, ULog), bag of ROS 2 or ROS 1, FLEA "
        "text (.data)",
    )
    add(
        "--template",
        default="",
        metavar="NAME",
        help="dc_screw, geared_joint, stepper_screw or wing (default: the one that fits); never "
        "guessed are vertical_axis, weighed_joint or gimbal",
    )
    add(
        "--joint",
        default="",
        metavar="NAME",
        help="joint, axis or drive to diagnose, by its name or number (default: one that moves)",
    )
    add(
        "--group",
        default="",
        metavar="NAME",
        help="namespace or group that the joint is in, of several",
    )
    add(
        "--channel",
        action="append",
        default=[],
        metavar="NAME=SOURCE[:UNIT]",
        help="source of a channel, and its unit, where the guess is wrong; may be repeated",
    )
    add(
        "--rate",
        type=positive,
        metavar="HZ",
        help="rate of the rows of a table without times; otherwise that of the scans",
    )
    add_json(parser, "what was taken for what, with doubts")


def run(arguments: argparse.Namespace) -> int:
    """Look at the recording and write the folder."""
    folder: Path = arguments.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigurationError(f"{folder} exists and is not empty: name a new folder")
    recording: Path = arguments.recording
    if recording.name.endswith(FLEA_SUFFIX):
        tell(arguments.json, *_of_the_flea(folder, recording, arguments.template))
        return 0
    from flea_diag.tools.series.reading_grid import reading_grid
    from flea_diag.tools.series.series_reader import recorded_series
    from flea_diag.tools.stand_folder.channel_file import channel_file
    from flea_diag.tools.stand_folder.folder_files import template_texts
    from flea_diag.tools.stand_folder.proposal import proposal
    from flea_diag.tools.stand_folder.proposal_page import as_mapping, as_text
    from flea_diag.tools.stand_folder.template import template

    recorded = recorded_series(recording)
    supplies = bool(arguments.template) and template(arguments.template).reads_supply
    grid = reading_grid(recorded, arguments.rate, arguments.joint, arguments.group, supplies)
    found = proposal(grid, arguments.template, _given(arguments.channel))
    texts = template_texts(found.template, folder, recording.name, found)
    _write(folder, {**texts, "channels.yaml": channel_file(found)})
    told, refused = _tried(folder, recording)
    content = {"stand": str(folder), **as_mapping(found), "refused": refused}
    tell(arguments.json, content, "\n".join([as_text(folder, recording, found), *told]))
    if refused:
        warn(refused)
    return IN_PART if refused else 0


def _of_the_flea(folder: Path, recording: Path, wanted: str) -> tuple[dict[str, Any], str]:
    """The text format of the FLEA needs no mapping; what was written, as JSON and in words."""
    from flea_diag.tools.recordings.flea_data import read_flea_data
    from flea_diag.tools.stand_folder.folder_files import shown_folder, template_texts
    from flea_diag.tools.stand_folder.template import template

    read_flea_data(recording)
    kind = template(wanted or "dc_screw")
    texts = template_texts(kind, folder, recording.name, None)
    _write(folder, {**texts, "channels.yaml": FLEA_TEXT})
    content = {"stand": str(folder), "template": kind.name, "format": "flea_text"}
    return content, (
        f"{folder}: {kind.title} (template {kind.name}), text format of the FLEA\n"
        f"next: flea import --stand {shown_folder(folder)} {recording} -o bags"
    )


def _given(said: list[str]) -> dict[str, GivenChannel]:
    """Channels whose sources the user names."""
    from flea_diag.core.symbolic.converted_unit import conversion
    from flea_diag.tools.stand_folder.channel_choice import GivenChannel

    found = {}
    for text in said:
        channel, mark, source = text.partition("=")
        if not (channel and mark and source):
            raise ConfigurationError(
                f"--channel {text} must be NAME=SOURCE or NAME=SOURCE:UNIT, such as "
                "motor_current=iq:mA"
            )
        name, mark, unit = source.rpartition(":")
        if mark and name and "/" not in unit.replace("/s", ""):
            conversion(unit, f"--channel {text}")
            found[channel] = GivenChannel(name, unit)
        else:
            found[channel] = GivenChannel(source)
    return found


def _write(folder: Path, texts: dict[str, str]) -> None:
    with writing(folder), new_folder(folder) as fresh:
        for name, text in texts.items():
            (fresh / name).write_text(text, encoding="utf-8")


def _tried(folder: Path, recording: Path) -> tuple[list[str], str]:
    """What is to be said of an import by what was written, and why there can be none."""
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.recordings.mapped_source import mapped_recordings

    try:
        mapping = channel_sources(load_stand(folder.absolute()))
        count = sum(1 for _ in mapped_recordings(recording, mapping))
    except FleaError as error:
        return [], str(error)
    if count == 1:
        return [], ""
    return [f"note: {recording.name} holds {count} recordings, flea import makes a bag of each"], ""
