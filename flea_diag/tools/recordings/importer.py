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

"""``flea import``: recordings of any make to bags, in SI units and our sign convention."""

from __future__ import annotations

import argparse
import heapq
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flea_diag.errors import ConfigurationError, FleaError, RecordingError
from flea_diag.tools.argument import add_jobs, add_json
from flea_diag.tools.refused import Refused
from flea_diag.tools.stand_option import add_stand
from flea_diag.tools.terminal import IN_PART, progress, say, warn, write_json, writing
from flea_diag.tools.workers import in_order
from flea_diag.wire.whole_file import replacing_folder

if TYPE_CHECKING:
    from flea_diag.tools.recordings.flea_run import FleaRun
    from flea_diag.tools.recordings.mapped_recording import MappedRecording
    from flea_diag.wire.records import Record
    from flea_diag.wire.sources.mapping import SourceMapping

NAME = "import"
SUMMARY = "convert recordings of a stand to bags (SI units, truth on a topic of its own)"
EXAMPLES = """\
examples:
  flea import --stand ./mine runs/*.csv.gz -o bags  tables, by the stand's channels.yaml
  flea import --stand ./mine joint_bag -o bags     a bag of ROS 2 or ROS 1 with topics of your own
  flea import FLEA/*.data -o bags -j 4             one bag per run, below bags/, 4 processes
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
    fault: str | None
    onset_s: float | None
    warnings: tuple[str, ...]
    test_actuator: str = ""
    dropped_lines: int = 0
    duplicate_stamps: int = 0
    backward_stamps: int = 0


class FileImport(NamedTuple):
    """The bags of one file, and why the rest of it is refused."""

    bags: tuple[Imported, ...]
    refused: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="table (CSV, TSV, XLSX, NPZ, Parquet, MAT, HDF5, ULog), bag of ROS 2 or ROS 1; FLEA "
        "text by default",
    )
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="BAGDIR", help="folder for the bags"
    )
    parser.add_argument(
        "--serial",
        default="",
        help="serial number of the test actuator (not in the recordings); `flea trend` groups "
        "bags by it",
    )
    add_stand(parser)
    add_jobs(parser)
    parser.add_argument("--force", action="store_true", help="replace existing bags")
    add_json(parser, "the bags with scans, truth and warnings")


def run(arguments: argparse.Namespace) -> int:
    """Import all files; a refused file does not stop the others."""
    mapping = _mapping(arguments.stand)
    if mapping is not None and arguments.serial:
        raise ConfigurationError(
            f"--serial {arguments.serial}: serials of this stand are in {mapping.where} (serial)"
        )
    done: list[Imported] = []
    refused: list[str] = []
    files, began_s = arguments.files, time.monotonic()
    work = partial(_import_file, mapping=mapping, output=arguments.output, force=arguments.force,
                   serial=arguments.serial)  # fmt: skip
    # Files of one name would have one bag, which is refused of the second: one after the other.
    names = {file.name.partition(".")[0] for file in files}
    jobs = arguments.jobs if len(names) == len(files) else 1
    progress(1, len(files), files[0].name)
    for number, result in enumerate(in_order(work, files, jobs), 2):
        found = FileImport((), result.words) if isinstance(result, Refused) else result
        done += found.bags
        for words in (warning for bag in found.bags for warning in bag.warnings):
            warn(words)
        if found.refused:
            refused.append(found.refused)
            warn(found.refused)
        if number <= len(files):
            progress(number, len(files), files[number - 1].name, began_s)
    _report(done, arguments.json)
    incomplete = sum(1 for each in done if each.dropped_lines)
    if not refused and not incomplete:
        return 0
    warn(
        f"{len(done)} of {len(arguments.files)} files imported, {len(refused)} refused, "
        f"{incomplete} with lines dropped"
    )
    return IN_PART


def _mapping(stand: str) -> SourceMapping | None:
    """Mapping of the stand; None where its recordings are the FLEA's text files."""
    if not stand:
        return None
    from flea_diag.configuration.acceptance import require_accepted
    from flea_diag.configuration.channels import channel_sources
    from flea_diag.configuration.stand import load_stand
    from flea_diag.wire.sources.mapping import FLEA_TEXT

    known = load_stand(stand)
    require_accepted(known)
    found = channel_sources(known)
    return None if found.format == FLEA_TEXT else found


def _import_file(
    file: Path, mapping: SourceMapping | None, output: Path, force: bool, serial: str
) -> FileImport:
    """Write the bags of one file, as far as it is not refused."""
    done: list[Imported] = []
    try:
        done.extend(_imports(file, mapping, output, force, serial))
    except FleaError as error:
        return FileImport(tuple(done), str(error))
    return FileImport(tuple(done))


def _imports(
    file: Path, mapping: SourceMapping | None, output: Path, force: bool, serial: str
) -> Iterator[Imported]:
    if mapping is None:
        yield import_run(file, output, force, serial)
        return
    from flea_diag.tools.recordings.mapped_source import mapped_recordings

    # All of them, so that nothing is written of a file that is refused.
    for recording in list(mapped_recordings(file, mapping)):
        directory = output / recording.name
        _check_room(directory, force)
        write_recording(recording, directory, mapping.stand)
        yield _mapped(file, recording, directory)


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
    _check_room(directory, force)
    write_recording(flea_run, directory, "flea")
    return _imported(flea_run, directory)


def _check_room(directory: Path, force: bool) -> None:
    """Refuse to replace what is not wanted to be, or is no bag."""
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


def write_recording(recording: FleaRun | MappedRecording, directory: Path, stand: str) -> None:
    """Write all records, in place of an earlier bag once it is complete.

    Log times never decrease, so that the order of the file is kept.
    """
    with writing(directory), replacing_folder(directory) as fresh:
        _write(recording, fresh, directory, stand)


def _write(recording: FleaRun | MappedRecording, fresh: Path, directory: Path, stand: str) -> None:
    from flea_diag.wire.bags.bag import BagWriter

    with BagWriter(fresh, stand=stand, whole_every_s=None, called=directory) as bag:
        bag.write_all(records_of(recording))


def records_of(recording: FleaRun | MappedRecording) -> Iterator[Record]:
    """Channel table, truth, then scans and vibration by their stamps."""
    yield recording.channel_table()
    truth = recording.truth()
    if truth is not None:
        yield truth
    streams = recording.scans(), recording.vibration
    yield from heapq.merge(*streams, key=lambda each: each.stamp_ns)


def _mapped(file: Path, recording: MappedRecording, directory: Path) -> Imported:
    scans, truth = recording.scans(), recording.truth()
    fault = truth.fault if truth else None
    return Imported(
        file=str(file),
        bag=str(directory),
        scans=len(scans),
        duration_s=round((scans[-1].stamp_ns - scans[0].stamp_ns) * 1e-9, 6),
        fault=fault,
        onset_s=None if fault in (None, "nominal") else 0.0,
        warnings=recording.warnings,
    )


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


def _report(done: list[Imported], target: str | None) -> None:
    if target:
        write_json(target, [asdict(each) for each in done])
    if target == "-":
        return
    for each in done:
        onset = "" if each.onset_s is None else f" from {each.onset_s:.2f} s"
        fault = each.fault or "no truth"
        say(f"{each.bag}: {each.scans} scans, {each.duration_s:.2f} s, {fault}{onset}")
