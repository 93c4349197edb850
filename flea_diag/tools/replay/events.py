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

"""``flea events``: the episodes of a bag as events, for the log panels and timelines of viewers."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flea_diag.errors import RecordingError
from flea_diag.tools.argument import add_json
from flea_diag.tools.stand_option import add_calibration, add_stand, given_stand
from flea_diag.tools.terminal import tell

if TYPE_CHECKING:
    from flea_diag.wire.blocks import Block
    from flea_diag.wire.records import AmbiguityGroup, Level, Record

NAME = "events"
SUMMARY = "write the episodes of a bag as events for Foxglove and PlotJuggler"
EXAMPLES = """\
examples:
  flea events bags/run                      to bags/run_events
  flea events bags/run -o events            to another new bag
  flea events bags/run --calibration cal.yaml    from a new diagnosis

The events are a bag of their own, of rcl_interfaces/Log on /episodes: open it together with the
recording. Foxglove lists them in its Log panel, whose scroll bar marks warnings and errors.
"""
TOPIC = "episodes"
ANEW = "calibration; with it, or with --stand, the bag is diagnosed again"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bag", type=Path, metavar="BAGDIR", help="recording")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="BAGDIR", help="new bag (default: BAGDIR_events)"
    )
    add_stand(parser)
    add_calibration(parser, ANEW)
    add_json(parser, "the events")


class Event(NamedTuple):
    """One line of the course of an episode."""

    stamp_ns: int
    level: Level
    source: str
    text: str


def run(arguments: argparse.Namespace) -> int:
    """Write the events of one bag."""
    from flea_diag.tools.replay.replay import diagnosis
    from flea_diag.wire.records import AmbiguityGroup, Detection, Remark

    source: Path = arguments.bag
    target = arguments.output or source.with_name(f"{source.name}_events")
    kinds = Detection, AmbiguityGroup, Remark
    found = list(events(diagnosis(source, given_stand(arguments), kinds)))
    write(target, found)
    rows = [event._asdict() for event in found]
    tell(arguments.json, rows, f"{target}: {len(found)} events")
    return 0


def events(records: Iterable[Record | Block]) -> Iterator[Event]:
    """Each detection, each change of outcome or members, and what operators said."""
    from flea_diag.wire.records import AmbiguityGroup, Detection, Remark
    from flea_diag.wire.wording import words_of

    said: tuple[object, ...] = ()
    for record in records:
        if isinstance(record, Detection | Remark):
            words = words_of(record)
            yield Event(record.stamp_ns, words.level, words.name, words.message)
        elif isinstance(record, AmbiguityGroup) and not record.stale:
            state = record.outcome, record.episode, frozenset(m.fault for m in record.members)
            if state != said:
                said = state
                yield _verdict(record)


def _verdict(group: AmbiguityGroup) -> Event:
    from flea_diag.wire.messages.summary import summary
    from flea_diag.wire.records import OUTCOME_LEVEL

    text = f"{group.outcome.value}: {summary(group).words}"
    return Event(group.stamp_ns, OUTCOME_LEVEL[group.outcome], "ambiguity_group", text)


def write(target: Path, found: Iterable[Event]) -> None:
    """Write events to a new bag that ``ros2 bag play`` and viewers open.

    Raises
    ------
    RecordingError
        The folder exists, or cannot be written.
    """
    import yaml

    from flea_diag.wire.bags import bag_layout as layout
    from flea_diag.wire.bags.bag_segment import BagSegment
    from flea_diag.wire.messages.log import LOG, encode_log
    from flea_diag.wire.topics import Topic
    from flea_diag.wire.whole_file import new_folder

    topic = Topic(Event, TOPIC, LOG, 1000, False, 0)
    try:
        with new_folder(target) as fresh:
            segment = BagSegment(fresh / f"{fresh.resolve().name}_0.mcap")
            with closing(segment):
                for event in found:
                    data = encode_log(*event)
                    segment.add(f"/{TOPIC}", topic, data, event.stamp_ns, event.stamp_ns)
                content = layout.metadata(
                    [(segment.path.name, segment.span)], {f"/{TOPIC}": layout.entry_of(topic)}
                )
                segment.finish(yaml.safe_dump(content, sort_keys=False))
            layout.replace_metadata(fresh, content)
    except FileExistsError:
        raise RecordingError(f"{target} exists: choose another with -o") from None
    except OSError as error:
        raise RecordingError(f"cannot write {target}: {error.strerror or error}") from error
