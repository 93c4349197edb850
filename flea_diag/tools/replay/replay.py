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

"""``flea replay``: diagnosis of a bag without ROS, reproducible bit for bit."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError, RecordingError, shown
from flea_diag.tools.argument import add_cluster, add_jobs, add_json
from flea_diag.tools.bag_url import BagUrl, bag_place, local
from flea_diag.tools.numeric_backend import numeric_backend
from flea_diag.tools.refused import Refused, refusing
from flea_diag.tools.stand_option import absolute, accepted_stand, add_calibration, add_stand
from flea_diag.tools.terminal import IN_PART, progress, say, warn, write_json
from flea_diag.tools.workers import in_order

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.stages.pipeline import Pipeline
    from flea_diag.tools.recordings.raw_recordings import Bags
    from flea_diag.tools.replay.result_folder import ResultFolder
    from flea_diag.wire.blocks import Block, ScanBlock
    from flea_diag.wire.records import Record

NAME = "replay"
SUMMARY = "diagnose bags faster than real time, without ROS"
EXAMPLES = """\
examples:
  flea replay bags/run                              print the verdict
  flea replay bags/run --calibration cal.yaml --json -
  flea replay bags/run --stand ./mine               on a stand of your own
  flea replay runs/*.csv --stand ./mine             raw, without an import
  flea replay bags/* --json results/ -q -j 4        write one JSON file per bag, 4 processes
  flea replay bags/jam --calibration mine.yaml --configuration evidence
  flea replay bags/* --json results/ --resume       go on after an interruption
  flea replay s3://bucket/run https://host/bags/run --dask tcp://host:8786
"""


PRODUCT, EVIDENCE = "hybrid", "evidence"
"""Configurations, as ``configuration.component`` has them, which is slow to import."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "bags",
        nargs="+",
        type=bag_place,
        metavar="BAGDIR",
        help="recordings to diagnose: bags, their URLs (needs the extra url), or raw files that "
        "the channels.yaml of the stand describes",
    )
    add_stand(parser)
    add_calibration(parser)
    add_json(
        parser,
        "the summaries",
        "on standard output, to the file OUT (several bags as a list), or one file per bag to the "
        "folder OUT/",
    )
    parser.add_argument("--namespace", help="namespace of the stand, if a bag contains several")
    parser.add_argument(
        "--configuration",
        choices=(PRODUCT, EVIDENCE),
        default=PRODUCT,
        help="hybrid: the whole method; evidence: one evidence by the law of the calibration, "
        "without accelerometers, beside it for comparison (default: %(default)s)",
    )
    add_jobs(parser)
    add_cluster(parser)
    parser.add_argument(
        "--resume",
        action="store_true",
        help="leave alone the bags whose results are in the folder of --json, made by the same "
        "stand, calibration and version",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="do not print the verdict")


def run(arguments: argparse.Namespace) -> int:
    """Replay all bags; a refused bag does not stop the others."""
    _check_names(arguments.json, arguments.bags)
    stand = accepted_stand(arguments, "calibration")
    if arguments.dask:  # its workers are elsewhere, in another folder
        stand = absolute(stand)
    from flea_diag.tools.recordings.raw_recordings import as_bags
    from flea_diag.tools.replay.result_folder import MADE_BY, ResultFolder, made_by

    target = arguments.json or ""
    by = made_by(stand, arguments.configuration, arguments.namespace) if target else ""
    folder = ResultFolder(Path(target), by) if target and _is_folder(target) else None
    given = _left(arguments.bags, folder) if arguments.resume else arguments.bags
    kept: list[dict[str, Any]] = []
    done = in_part = 0
    with as_bags(given, stand) as bags:
        for summary in _replays(bags, stand, arguments):
            done, in_part = done + 1, in_part + bool(summary["losses"])
            _say(summary, arguments)
            summary[MADE_BY] = by
            if folder is not None:
                folder.add(summary)  # not kept: of a million bags they would fill the memory
            elif target:
                kept.append(summary)
        refused = len(bags.refused) + len(bags.places) - done
    several = len(arguments.bags) > 1 or len(kept) > 1
    if target and folder is None and (kept or several):
        write_json(target, kept if several else kept[0])
    return _status(done, in_part, refused)


def _left(bags: Sequence[Path | BagUrl], folder: ResultFolder | None) -> Sequence[Path | BagUrl]:
    """Bags whose results are not in the folder yet."""
    if folder is None:
        raise ConfigurationError(
            "--resume: results are found again in a folder only: give it by --json FOLDER/"
        )
    left = [bag for bag in bags if not folder.holds(bag)]
    warn(f"{len(bags) - len(left)} of {len(bags)} bags are replayed already, {len(left)} are left")
    return left


def _replays(bags: Bags, stand: Stand, arguments: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Summaries of all that are not refused, each as soon as it is there."""
    names, began_s = bags.names, time.monotonic()
    read = [bag.absolute() for bag in bags.places] if arguments.dask else bags.places
    work = partial(
        _replayed, stand=stand, namespace=arguments.namespace, by=arguments.configuration
    )
    progress(1, len(names), names[0] if names else "")
    summed = in_order(work, read, arguments.jobs, arguments.dask)
    for number, summary in enumerate(summed, 1):
        if isinstance(summary, Refused):
            warn(summary.words)
        else:
            yield {**summary, "bag": names[number - 1]}
        if number < len(names):
            progress(number + 1, len(names), names[number], began_s)


def _pipeline(stand: Stand, by: str) -> Pipeline:
    from flea_diag.configuration.component import make_pipeline

    return make_pipeline(stand, configuration=by)


def _replayed(
    bag: Path | BagUrl, stand: Stand, namespace: str | None, by: str = PRODUCT
) -> dict[str, Any] | Refused:
    """Summary of a bag; a wrong calibration is refused before any bag is read."""
    pipeline = _pipeline(stand, by)

    def replayed() -> dict[str, Any]:
        with local(bag) as place:
            return replay(place, pipeline, namespace)

    return refusing(replayed)


def replay(bag: Path, pipeline: Pipeline, namespace: str | None = None) -> dict[str, Any]:
    """Feed the stand's records of a bag to a fresh pipeline, and summarise its output.

    Raises
    ------
    RecordingError
        There is no flea_diag bag, or no scan in it.
    """
    from flea_diag.tools.replay.recorded import RECORDED, RecordedDecisions
    from flea_diag.tools.replay.summary import BULK, summarise, without_values
    from flea_diag.wire.bags.bag import BagReader

    reader = BagReader(bag)
    recorded = RecordedDecisions()

    def sent() -> Iterator[Record | ScanBlock]:
        """Records of the stand; recorded decisions only enter digests of their own."""
        for record in reader.blocks((*sources(), *RECORDED), namespace):
            if isinstance(record, RECORDED):
                recorded.add(record)
            else:
                yield record

    said = diagnosed(sent(), pipeline)
    kept = [without_values(each) for each in said if not isinstance(each, BULK)]
    summary = summarise(kept)
    if not summary["scans"]:
        raise RecordingError(f"{bag}: no scan (topic sensors/slow), nothing to diagnose")
    return {
        **summary,
        "backend": numeric_backend(),
        "bag": str(bag),
        **recorded.digests(),
        "losses": reader.losses,
    }


def sources() -> tuple[type, ...]:
    """Record types that are the input of a diagnosis."""
    from flea_diag.wire.records import ChannelTable, Remark, Scan, VibrationBlock

    return (ChannelTable, VibrationBlock, Scan, Remark)


def diagnosed(
    records: Iterable[Record | ScanBlock], pipeline: Pipeline
) -> Iterator[Record | Block]:
    """Each record followed by the resulting records; at the end those still held back."""
    from flea_diag.wire.blocks import ScanBlock

    for record in records:
        yield record
        by_block = isinstance(record, ScanBlock)
        yield from pipeline.handle_block(record) if by_block else pipeline.handle(record)
    yield from pipeline.finish()


def diagnosis(bag: Path, stand: Stand | None, kinds: tuple[type, ...]) -> Iterable[Record | Block]:
    """The diagnosis recorded in a bag; a new one where it holds none, or on a given stand.

    ``kinds`` are the types of record that are wanted, the verdict among them.

    Raises
    ------
    RecordingError
        There is no flea_diag bag.
    """
    from flea_diag.configuration.component import make_pipeline
    from flea_diag.configuration.stand import load_stand
    from flea_diag.stages.digest import DECISIONS
    from flea_diag.tools.replay.recorded import completed
    from flea_diag.wire.bags.bag import BagReader
    from flea_diag.wire.records import AmbiguityGroup, Hypotheses

    reader = BagReader(bag)
    if stand is None:
        recorded = [record for _, record in reader.records((*kinds, Hypotheses))]
        if any(isinstance(record, AmbiguityGroup) for record in recorded):
            return completed(recorded)
    given = (*sources(), *(kind for kind in kinds if kind not in (*sources(), *DECISIONS)))
    return diagnosed(reader.blocks(given), make_pipeline(stand or load_stand()))


def _say(summary: dict[str, Any], arguments: argparse.Namespace) -> None:
    from flea_diag.tools.replay.summary import in_words

    for loss in summary["losses"]:
        warn(f"{summary['bag']}: {loss}")
    if not arguments.quiet:
        say(in_words(summary), file=sys.stderr if arguments.json == "-" else sys.stdout)


def _check_names(target: str | None, bags: Sequence[Path | BagUrl]) -> None:
    """Refuse bags of equal names that would share one file in a folder."""
    if target is None or not _is_folder(target):
        return
    names = Counter(bag.resolve().name for bag in bags)
    double = next((name for name, count in names.items() if count > 1), None)
    if double is not None:
        raise ConfigurationError(
            f"--json {target}: {names[double]} bags are named {shown(double)} and would share "
            "one file: "
            "write all to one file (--json results.json)"
        )


def _is_folder(target: str) -> bool:
    return target.endswith("/") or Path(target).is_dir()


def _status(done: int, in_part: int, refused: int) -> int:
    if not refused and not in_part:
        return 0
    if done + refused > 1:
        warn(f"{done} of {done + refused} bags replayed, {refused} refused, {in_part} incomplete")
    return IN_PART
