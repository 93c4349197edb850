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

"""Recovery of a truncated bag: every intact message copied to a new bag."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import yaml

from flea_diag.errors import RecordingError
from flea_diag.wire.bags import bag_layout as layout
from flea_diag.wire.bags.bag_layout import TopicEntry
from flea_diag.wire.bags.bag_segment import BagSegment
from flea_diag.wire.bags.mcap_message import Channel, McapMessage
from flea_diag.wire.bags.mcap_scan import McapScan
from flea_diag.wire.whole_file import new_folder
from flea_diag.wire.yaml_text import parse_yaml


@dataclass(frozen=True)
class Recovered:
    """Recovered messages, and descriptions of the losses."""

    messages: int
    topics: int
    losses: tuple[str, ...]


def recover(source: Path, target: Path) -> Recovered:
    """Copy every intact message of a bag, of any recorder, to a new bag.

    Raises
    ------
    RecordingError
        There is no MCAP file or no intact message, or the target is in use.
    """
    scans = [McapScan(file) for file in mcap_files(source)]
    with _writing(target), new_folder(target) as fresh, _Copy(fresh) as copy:
        for message in merged(scans):
            copy.write(message)
        if not copy.counts:
            raise RecordingError(f"{source}: no intact message, nothing to recover")
        for scan in scans:
            for name, data in scan.attachments.items():
                copy.attach(name, data)
        copy.finish()
    losses = tuple(loss for scan in scans for loss in scan.losses)
    return Recovered(sum(copy.counts.values()), len(copy.counts), losses)


def mcap_files(source: Path) -> list[Path]:
    """MCAP files of a bag, or the one file given.

    Raises
    ------
    RecordingError
        There is none.
    """
    layout.refuse_closed(source)
    files = [source] if source.is_file() else sorted(source.glob("*.mcap"))
    if not files:
        why = "no .mcap file in this folder" if source.exists() else "does not exist"
        raise RecordingError(f"{source}: {why}")
    return files


def merged(scans: list[McapScan]) -> Iterator[McapMessage]:
    """Messages of all files in order of log time."""
    import heapq

    return heapq.merge(*(scan.messages() for scan in scans), key=lambda message: message.log_ns)


class _Copy:
    """A bag in a new folder."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._topics: dict[str, TopicEntry] = {}
        self._segment = BagSegment(directory / f"{directory.resolve().name}_0.mcap")

    @property
    def counts(self) -> dict[str, int]:
        """Messages copied so far, by topic."""
        return self._segment.span.counts

    def write(self, message: McapMessage) -> None:
        """Copy one message."""
        if message.channel.topic not in self._topics:
            self._topics[message.channel.topic] = _entry(message.channel)
        self._segment.copy(message)

    def attach(self, name: str, data: bytes) -> None:
        """Copy one attachment."""
        self._segment.attach(name, data)

    def finish(self) -> None:
        """Write summary, index and metadata.yaml."""
        segment = self._segment
        content = layout.metadata([(segment.path.name, segment.span)], self._topics)
        segment.finish(yaml.safe_dump(content, sort_keys=False))
        layout.replace_metadata(self._directory, content)

    def __enter__(self) -> _Copy:
        return self

    def __exit__(self, *_: object) -> None:
        self._segment.close()


@contextmanager
def _writing(target: Path) -> Iterator[None]:
    """Whatever keeps the bag from being written, in one line."""
    try:
        yield
    except FileExistsError:
        raise RecordingError(f"{target} is not empty: choose another with -o") from None
    except OSError as error:
        raise RecordingError(f"cannot write bag {target}: {error.strerror or error}") from error


def _entry(channel: Channel) -> TopicEntry:
    """QoS and type hash of a channel as recorded, else those of the topic table."""
    known = dict(channel.metadata)
    ours = layout.split_name(channel.topic)
    if ours is not None and ours[1].message == channel.message:
        entry = layout.entry_of(ours[1])
    else:
        entry = TopicEntry(channel.message, "", [])
    try:
        profiles = parse_yaml(known.get("offered_qos_profiles", ""))
    except ValueError:
        profiles = None
    qos = profiles if isinstance(profiles, list) else entry.qos
    return TopicEntry(channel.message, known.get("topic_type_hash", entry.type_hash), qos)
