"""``flea stand new``: writes the folder of a stand from one of its recordings."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError, FleaError
from flea_diag.tools.argument import positive
from flea_diag.tools.terminal import IN_PART, say, warn, writing
from flea_diag.wire.whole_file import new_folder

if TYPE_CHECKING:
    from flea_diag.tools.stand_folder.channel_choice import GivenChannel
    from flea_diag.tools.stand_folder.proposal import ChannelProposal, StandProposal

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
        help="dc_screw, geared_joint, stepper_screw or wing (default: the one that fits)",
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


def run(arguments: argparse.Namespace) -> int:
    """Look at the recording and write the folder."""
    folder: Path = arguments.folder
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigurationError(f"{folder} exists and is not empty: name a new folder")
    recording: Path = arguments.recording
    if recording.name.endswith(FLEA_SUFFIX):
        return _of_the_flea(folder, recording, arguments.template)
    from flea_diag.tools.series.reading_grid import reading_grid
    from flea_diag.tools.series.series_reader import recorded_series
    from flea_diag.tools.stand_folder.channel_file import channel_file
    from flea_diag.tools.stand_folder.folder_files import template_texts
    from flea_diag.tools.stand_folder.proposal import proposal

    recorded = recorded_series(recording)
    grid = reading_grid(recorded, arguments.rate, arguments.joint, arguments.group)
    found = proposal(grid, arguments.template, _given(arguments.channel))
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


def _print(folder: Path, recording: Path, found: StandProposal) -> None:
    """One page: what was taken for what, what to check, and how to go on."""
    from flea_diag.tools.stand_folder.folder_files import shown_folder
    from flea_diag.tools.stand_folder.seen_values import seen_values

    kind, rate = found.template, found.rate_hz
    say(f"{folder}: {kind.title} (template {kind.name}), {rate:g} scans a second{_joint(found)}")
    say()
    rows = [("channel", "source", "unit", "sign", "sure", "check"), *map(_cells, found.channels)]
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
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
    for words in (*found.grid.notes, *_doubts(found)):
        say(f"note: {words}")
    for words in seen_values(found):
        say(f"seen: {words}")
    name = shown_folder(folder)
    say(f"check in {name}/channels.yaml the lines that say check; positive must extend")
    say(f"check in {name}/actuator.yaml screw or gear ratio and travel")
    say()
    say(f"next: flea import --stand {name} {recording} -o bags")
    say(f"      flea calibrate bags/* --stand {name} -o {name}/calibration.yaml   (nominal bags)")
    say(f"      flea replay bags/NAME --stand {name}")


def _joint(found: StandProposal) -> str:
    joint, others = found.grid.joint, found.grid.joints
    if not joint:
        return ""
    of = f" of {', '.join(others[:8])} (--joint takes another)" if len(others) > 1 else ""
    return f", joint {joint}{of}"


def _cells(each: ChannelProposal) -> tuple[str, ...]:
    """Cells of a channel; what is doubtful is marked where it stands."""
    doubts = {words.partition(" ")[0] for words in each.doubts}
    source = each.source.name if len(each.source.name) <= 60 else f"...{each.source.name[-57:]}"
    texts = {"source": source, "unit": each.unit, "sign": "+" if each.sign > 0 else "-"}
    marked = [f"{text} (check)" if key in doubts else text for key, text in texts.items()]
    told = (d for d in each.doubts if " " in d or d not in texts)
    return (each.channel, *marked, f"{each.confidence:.0%}", ", ".join(told))


def _doubts(found: StandProposal) -> list[str]:
    """What is doubtful about the whole."""
    said = []
    if found.rivals:
        said.append(
            f"check: template {found.template.name}; {' or '.join(found.rivals)} fits as well "
            "(--template)"
        )
    if not found.moves:
        said.append(
            "check: nothing moves in this recording, so that neither signs nor units can be held "
            "against each other: take one with motion both ways"
        )
    return said


def _tried(folder: Path, recording: Path) -> int:
    """Whether the recording can be imported by what was written; if not, why."""
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.configuration.stand import load_stand
    from flea_diag.tools.recordings.mapped_source import mapped_recordings

    try:
        mapping = channel_sources(load_stand(folder.absolute()))
        count = sum(1 for _ in mapped_recordings(recording, mapping))
        if count > 1:
            say(f"note: {recording.name} holds {count} recordings, flea import makes a bag of each")
    except FleaError as error:
        warn(str(error))
        return IN_PART
    return 0
