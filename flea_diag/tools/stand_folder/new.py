"""``flea stand new``: writes the folder of a stand from one of its recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError, FleaError
from flea_diag.tools.argument import positive
from flea_diag.tools.terminal import IN_PART, make_folder, say, warn, write_text

if TYPE_CHECKING:
    from flea_diag.tools.stand_folder.proposal import StandProposal

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
        help="CSV (.csv, .csv.gz), NPZ, Parquet, bag of ROS 2 or ROS 1, FLEA text (.data)",
    )
    add(
        "--template",
        default="",
        metavar="NAME",
        help="dc_screw, geared_joint, stepper_screw or wing (default: the one that fits)",
    )
    add(
        "--joint",
        default="",
        metavar="NAME",
        help="joint of a JointState to diagnose (default: one that moves)",
    )
    add(
        "--rate",
        type=positive,
        metavar="HZ",
        help="rate of the rows, for a table without a column of times",
    )


def run(arguments: argparse.Namespace) -> int:
    """Look at the recording and write the folder."""
    folder: Path = arguments.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigurationError(f"{folder} exists and is not empty: name a new folder")
    recording: Path = arguments.recording
    if recording.name.endswith(FLEA_SUFFIX):
        return _of_the_flea(folder, recording, arguments.template)
    from flea_diag.tools.stand_folder.channel_file import channel_file
    from flea_diag.tools.stand_folder.folder_files import template_texts
    from flea_diag.tools.stand_folder.proposal import proposal
    from flea_diag.tools.stand_folder.reading_grid import reading_grid
    from flea_diag.tools.stand_folder.recorded_series import recorded_series

    grid = reading_grid(recorded_series(recording), arguments.rate, arguments.joint)
    found = proposal(grid, arguments.template)
    texts = template_texts(found.template, folder, recording.name, found)
    _write(folder, {**texts, "channels.yaml": channel_file(found)})
    _print(folder, recording, found)
    return _tried(folder, recording)


def _of_the_flea(folder: Path, recording: Path, wanted: str) -> int:
    """The text format of the FLEA needs no mapping."""
    from flea_diag.tools.recordings.flea_data import read_flea_data
    from flea_diag.tools.stand_folder.folder_files import shown_folder, template_texts
    from flea_diag.tools.stand_folder.template import template

    read_flea_data(recording)
    kind = template(wanted or "dc_screw")
    texts = template_texts(kind, folder, recording.name, None)
    _write(folder, {**texts, "channels.yaml": FLEA_TEXT})
    say(f"{folder}: {kind.title} (template {kind.name}), text format of the FLEA")
    say(f"next: flea import --stand {shown_folder(folder)} {recording} -o bags")
    return 0


def _write(folder: Path, texts: dict[str, str]) -> None:
    make_folder(folder)
    for name, text in texts.items():
        write_text(folder / name, text)


def _print(folder: Path, recording: Path, found: StandProposal) -> None:
    """One page: what was taken for what, what to check, and how to go on."""
    from flea_diag.tools.stand_folder.folder_files import shown_folder
    from flea_diag.tools.stand_folder.seen_values import seen_values

    kind, rate = found.template, found.rate_hz
    joint = f", joint {found.grid.joint}" if found.grid.joint else ""
    say(f"{folder}: {kind.title} (template {kind.name}), {rate:g} scans a second{joint}")
    say()
    rows = [("channel", "source", "unit", "sign", "check")]
    for each in found.channels:
        rows.append(
            (
                each.channel,
                each.source.name[:44],
                each.unit,
                "+" if each.sign > 0 else "-",
                ", ".join(each.doubts),
            )
        )
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    for row in rows:
        say(
            "  "
            + "  ".join(f"{text:{width}}" for text, width in zip(row, widths, strict=True)).rstrip()
        )
    missing = [n for n in kind.model.sensors if n not in {each.channel for each in found.channels}]
    say()
    if missing:
        say(f"not recorded: {', '.join(missing)}")
    if found.unused:
        say(f"not used: {', '.join(name for name, _ in found.unused[:8])}"
            f"{f' and {len(found.unused) - 8} more' if len(found.unused) > 8 else ''}")  # fmt: skip
    for words in seen_values(found):
        say(f"seen: {words}")
    name = shown_folder(folder)
    say(f"check in {name}/channels.yaml the lines that say check; positive must extend")
    say(f"check in {name}/actuator.yaml screw or gear ratio and travel")
    say()
    say(f"next: flea import --stand {name} {recording} -o bags")
    say(f"      flea calibrate bags/* --stand {name} -o {name}/calibration.yaml   (nominal bags)")
    say(f"      flea replay bags/NAME --stand {name}")


def _tried(folder: Path, recording: Path) -> int:
    """Whether the recording can be imported by what was written; if not, why."""
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.recordings.mapped_recording import mapped_recordings

    try:
        for _ in mapped_recordings(recording, channel_sources(load_stand(folder.absolute()))):
            pass
    except FleaError as error:
        warn(str(error))
        return IN_PART
    return 0
