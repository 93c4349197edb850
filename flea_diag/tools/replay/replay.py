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
from flea_diag.tools.terminal import IN_PART, make_folder, progress, say, warn, write_json
from flea_diag.tools.workers import in_order

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.stages.pipeline import Pipeline
    from flea_diag.tools.recordings.raw_recordings import Bags
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
    parser.add_argument("-q", "--quiet", action="store_true", help="do not print the verdict")


def run(arguments: argparse.Namespace) -> int:
    """Replay all bags; a refused bag does not stop the others."""
    _check_names(arguments.json, arguments.bags)
    stand = accepted_stand(arguments, "calibration")
    if arguments.dask:  # its workers are elsewhere, in another folder
        stand = absolute(stand)
    from flea_diag.tools.recordings.raw_recordings import as_bags

    with as_bags(arguments.bags, stand) as bags:
        summaries = _all_replayed(bags, stand, arguments)
        refused = len(bags.refused) + len(bags.places) - len(summaries)
    if arguments.json:
        _write(arguments.json, summaries, several=len(arguments.bags) > 1 or len(summaries) > 1)
    return _status(summaries, refused, len(summaries) + refused)


def _all_replayed(bags: Bags, stand: Stand, arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Summaries of all that are not refused; each is said as soon as it is there."""
    summaries: list[dict[str, Any]] = []
    names, began_s = bags.names, time.monotonic()
    read = [bag.absolute() for bag in bags.places] if arguments.dask else bags.places
    work = partial(
        _replayed, stand=stand, namespace=arguments.namespace, by=arguments.configuration
    )
    progress(1, len(names), read[0].name)
    summed = in_order(work, read, arguments.jobs, arguments.dask)
    for number, summary in enumerate(summed, 2):
        if isinstance(summary, Refused):
            warn(summary.words)
        else:
            summary["bag"] = names[number - 2]
            summaries.append(summary)
            _say(summary, arguments)
        if number <= len(names):
            progress(number, len(names), read[number - 1].name, began_s)
    return summaries


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


def _write(target: str, summaries: list[dict[str, Any]], several: bool) -> None:
    if _is_folder(target):
        make_folder(Path(target))
        for summary in summaries:
            name = Path(summary["bag"]).resolve().name
            write_json(str(Path(target) / f"{name}.json"), summary)
    elif several:
        write_json(target, summaries)
    elif summaries:
        write_json(target, summaries[0])


def _status(summaries: list[dict[str, Any]], refused: int, count: int) -> int:
    in_part = sum(1 for summary in summaries if summary["losses"])
    if not refused and not in_part:
        return 0
    if count > 1:
        warn(f"{len(summaries)} of {count} bags replayed, {refused} refused, {in_part} incomplete")
    return IN_PART
