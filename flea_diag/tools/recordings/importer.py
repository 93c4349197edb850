"""``flea import``: recordings of NASA's FLEA stand to bags, in SI units and our sign convention."""

from __future__ import annotations

import argparse
import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import FleaError, RecordingError
from flea_diag.tools.terminal import IN_PART, progress, say, warn

if TYPE_CHECKING:
    from flea_diag.tools.recordings.flea_run import FleaRun

NAME = "import"
SUMMARY = "convert FLEA .data recordings to bags (SI units, truth on a topic of its own)"
EXAMPLES = """\
examples:
  flea import FLEA/*.data -o bags                  one bag per run, below bags/
  flea import run_Low.data -o bags --force         replace the bag of an earlier import
  flea import FLEA/*_Jam_* -o bags --serial X-1    with the serial number, for `flea trend`
"""


@dataclass(frozen=True)
class Imported:
    """Result of the import of one file."""

    file: str
    bag: str
    scans: int
    duration_s: float
    test_actuator: str
    fault: str | None
    onset_s: float | None
    dropped_lines: int
    duplicate_stamps: int
    backward_stamps: int
    warnings: tuple[str, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("files", nargs="+", type=Path, metavar="RUN.data", help="FLEA recordings")
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="BAGDIR", help="folder for the bags"
    )
    parser.add_argument(
        "--serial",
        default="",
        help="serial number of the test actuator (not in the recordings); `flea trend` groups "
        "bags by it",
    )
    parser.add_argument("--force", action="store_true", help="replace existing bags")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Import all files; a refused file does not stop the others."""
    done: list[Imported] = []
    refused: list[str] = []
    for number, file in enumerate(arguments.files, 1):
        progress(number, len(arguments.files), file.name)
        try:
            done.append(import_run(file, arguments.output, arguments.force, arguments.serial))
        except FleaError as error:
            refused.append(str(error))
            warn(str(error))
        else:
            for warning in done[-1].warnings:
                warn(warning)
    _report(done, arguments.json)
    incomplete = sum(1 for each in done if each.dropped_lines)
    if not refused and not incomplete:
        return 0
    warn(
        f"{len(done)} of {len(arguments.files)} files imported, {len(refused)} refused, "
        f"{incomplete} with lines dropped"
    )
    return IN_PART


def import_run(file: Path, output: Path, force: bool = False, serial: str = "") -> Imported:
    """Write the bag of one file, below ``output`` and named like the file.

    Raises
    ------
    RecordingError
        The file is not usable, or the bag exists.
    """
    from flea_diag.tools.recordings.flea_data import read_flea_data
    from flea_diag.tools.recordings.flea_run import FleaRun

    flea_run = FleaRun.of(read_flea_data(file), serial)
    directory = output / file.name.removesuffix(".data")
    _make_room(directory, force)
    _write(flea_run, directory)
    return _imported(flea_run, directory)


def _make_room(directory: Path, force: bool) -> None:
    if not directory.exists():
        return
    content = sorted(entry.name for entry in directory.iterdir()) if directory.is_dir() else ["?"]
    if not force:
        raise RecordingError(f"{directory} exists: use --force to replace it")
    stray = [n for n in content if not n.endswith(".mcap") and not n.endswith("metadata.yaml")]
    if stray:
        raise RecordingError(
            f"{directory} contains {stray[0]!r}: not a bag, not replaced, choose another -o"
        )
    shutil.rmtree(directory)


def _write(flea_run: FleaRun, directory: Path) -> None:
    """Write all records; log times never decrease, so that the order of the file is kept."""
    from flea_diag.wire.bags.bag import BagWriter

    with BagWriter(directory, stand="flea", whole_every_s=None) as bag:
        bag.write(flea_run.channel_table())
        truth = flea_run.truth()
        if truth is not None:
            bag.write(truth)
        log_ns = 0
        for scan in flea_run.scans():
            log_ns = max(log_ns, scan.stamp_ns)
            bag.write(scan, log_ns)


def _imported(flea_run: FleaRun, directory: Path) -> Imported:
    stamps = flea_run.data.stamps_ns
    steps = stamps[1:] - stamps[:-1]
    warnings = list(flea_run.data.dropped[:3])
    if len(flea_run.data.dropped) > len(warnings):
        warnings.append(f"{flea_run.data.path.name}: {len(flea_run.data.dropped)} lines dropped")
    if flea_run.label is None:
        warnings.append(f"{flea_run.data.path.name}: no fault label in the name, no truth written")
    onset = flea_run.onset
    return Imported(
        file=str(flea_run.data.path),
        bag=str(directory),
        scans=len(stamps),
        duration_s=round(float(stamps[-1] - stamps[0]) * 1e-9, 6),
        test_actuator=flea_run.unit,
        fault=flea_run.label.fault if flea_run.label else None,
        onset_s=None if onset is None else round(float(stamps[onset] - stamps[0]) * 1e-9, 6),
        dropped_lines=len(flea_run.data.dropped),
        duplicate_stamps=int((steps == 0).sum()),
        backward_stamps=int((steps < 0).sum()),
        warnings=tuple(warnings),
    )


def _report(done: list[Imported], as_json: bool) -> None:
    if as_json:
        say(json.dumps([asdict(each) for each in done], indent=2))
        return
    for each in done:
        onset = "" if each.onset_s is None else f" from {each.onset_s:.2f} s"
        say(f"{each.bag}: {each.scans} scans, {each.duration_s:.2f} s, {each.fault}{onset}")
