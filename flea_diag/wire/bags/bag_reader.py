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

"""Reads records from a bag of any recorder, as far as the bag is intact."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from itertools import groupby, repeat
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError, WireError, shown
from flea_diag.wire.bags.bag_description import BagDescription, described
from flea_diag.wire.bags.bag_layout import (
    METADATA_FILE,
    checked_namespace,
    refuse_closed,
    split_name,
)
from flea_diag.wire.bags.mcap_message import McapMessage, extent
from flea_diag.wire.bags.mcap_scan import McapScan
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.bags.sqlite_source import SqliteSource
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.messages.codec import decode
from flea_diag.wire.records import Record, Scan
from flea_diag.wire.regular_file import missing
from flea_diag.wire.topics import TOPIC_OF, Topic

BLOCK_SCANS, PIECE_SCANS = 2048, 256
BLOCK_BYTES = 16 << 20


class BagReader:
    """One bag: a folder of rosbag2, or a single .mcap file.

    Attributes
    ----------
    namespaces
        Namespaces with flea_diag topics.
    topics
        Every topic of the bag with its message type.
    attachments
        Texts attached to the bag, by name.
    losses
        Descriptions of unreadable parts; complete once ``records`` has been read to its end.

    Raises
    ------
    RecordingError
        There is no bag, or no flea_diag topic in it.
    """

    def __init__(self, directory: Path | str) -> None:
        self.path = Path(directory)
        self.losses: list[str] = []
        self._unreadable: dict[str, int] = {}
        self._stated: dict[str, int] = {}
        self._sources = sources_of(self.path, self.losses, self._stated)
        self.topics: dict[str, str] = {}
        for source in self._sources:
            channels = source.channels.values()
            self.topics.update((c.topic, c.message) for c in channels if c.encoding == "cdr")
        self._rows = {
            name: found
            for name, message in self.topics.items()
            if (found := split_name(name)) is not None and found[1].message == message
        }
        if not self._rows:
            raise RecordingError(self._foreign())
        self.namespaces = self._find_namespaces()

    def _find_namespaces(self) -> tuple[str, ...]:
        """Namespaces of the topics; /diagnostics belongs to no particular stand."""
        own = {space for space, topic in self._rows.values() if not topic.name.startswith("/")}
        return tuple(sorted(own)) or ("",)

    @property
    def attachments(self) -> dict[str, str]:
        """Texts attached to the bag, by name."""
        return {
            name: data.decode(errors="replace")
            for source in self._sources
            for name, data in source.attachments.items()
        }

    def _foreign(self) -> str:
        has = ", ".join(f"{name} ({kind})" for name, kind in sorted(self.topics.items())[:5])
        scan = TOPIC_OF[Scan]
        return (
            f"{self.path} contains no flea_diag topic such as {scan.name} ({scan.message}); "
            f"its topics: {has or 'none'}"
        )

    def records(
        self, types: Iterable[type] | None = None, namespace: str | None = None
    ) -> Iterator[tuple[int, Record]]:
        """Log times in ns and records, in log order; all types of one namespace by default.

        Raises
        ------
        RecordingError
            The bag contains several namespaces and none is chosen.
        """
        for kind, message in self._messages(types, namespace):
            yield from self._decoded(kind, message)
        self._collect_losses()

    def blocks(
        self, types: Iterable[type] | None = None, namespace: str | None = None
    ) -> Iterator[Record | ScanBlock]:
        """Records in log order as from ``records``, with consecutive scans as blocks."""
        for kind, part in _parts(self._together(types, namespace)):
            block = _block(part) if kind is Scan else None
            if block is not None:
                yield block
            else:
                yield from (r for m in part for _, r in self._decoded(kind, m))
        self._collect_losses()

    def _messages(
        self, types: Iterable[type] | None, namespace: str | None
    ) -> Iterator[tuple[type, McapMessage]]:
        """Messages on flea_diag topics in log order, with the record type of each."""
        for kind, part in self._together(types, namespace):
            yield from zip(repeat(kind), part, strict=False)

    def _together(
        self, types: Iterable[type] | None, namespace: str | None
    ) -> Iterator[tuple[type, list[McapMessage]]]:
        """The same, with those on one topic together that follow each other."""
        wanted = self._wanted(None if types is None else set(types), self._chosen(namespace))
        ordered = self._sources[0].together()
        if len(self._sources) > 1:
            merged = heapq.merge(*(s.messages() for s in self._sources), key=itemgetter(0))
            ordered = ([message] for message in merged)
        read = dict.fromkeys(wanted, 0)
        for messages in ordered:
            for channel, group in groupby(messages, attrgetter("channel")):
                topic = wanted.get(channel.topic)
                if topic is not None and channel.message == topic.message:
                    part = list(group)
                    read[channel.topic] += len(part)
                    yield topic.record, part
        self.losses += [
            f"{name}: {self._stated[name] - count} of the {self._stated[name]} messages that "
            f"{METADATA_FILE} counts are not in the bag"
            for name, count in read.items()
            if count < self._stated.get(name, 0)
        ]

    def _decoded(self, kind: type, message: McapMessage) -> Iterator[tuple[int, Record]]:
        """Log time and record of one message; nothing if it is unreadable."""
        try:
            record: Record = decode(kind, message.data)
        except WireError as error:
            self._count_unreadable(message, error)
        else:
            yield message.log_ns, record

    def _chosen(self, namespace: str | None) -> str:
        has = ", ".join(name or "/" for name in self.namespaces)
        if namespace is None:
            if len(self.namespaces) > 1:
                raise RecordingError(f"{self.path} contains several stands: choose one of {has}")
            return self.namespaces[0]
        chosen = checked_namespace(namespace)
        if chosen not in self.namespaces:
            raise RecordingError(f"{self.path} has no namespace {shown(namespace)}, it has {has}")
        return chosen

    def _wanted(self, types: set[type] | None, namespace: str) -> dict[str, Topic]:
        return {
            name: topic
            for name, (space, topic) in self._rows.items()
            if (space == namespace or topic.name.startswith("/"))
            and (types is None or topic.record in types)
        }

    def _count_unreadable(self, message: McapMessage, error: WireError) -> None:
        topic = message.channel.topic
        self._unreadable[topic] = self._unreadable.get(topic, 0) + 1
        if self._unreadable[topic] == 1:
            self.losses.append(f"{topic}: first unreadable message at {message.log_ns} ns: {error}")

    def _collect_losses(self) -> None:
        for source in self._sources:
            self.losses += [loss for loss in source.losses if loss not in self.losses]
        self.losses += [
            f"{topic}: {count} unreadable messages" for topic, count in self._unreadable.items()
        ]


def _parts(
    together: Iterator[tuple[type, list[McapMessage]]],
) -> Iterator[tuple[type, list[McapMessage]]]:
    """Consecutive scans, up to a number and a size, for few large ones fill the memory, too.

    Every other message is a part of its own.
    """
    scans: list[McapMessage] = []
    held_bytes = 0
    for kind, messages in together:
        if kind is not Scan and scans:
            yield Scan, scans
            scans, held_bytes = [], 0
        for size_bytes, piece in _pieces(messages) if kind is Scan else ():
            many = len(scans) + len(piece) > BLOCK_SCANS
            if scans and (many or held_bytes + size_bytes > BLOCK_BYTES):
                yield Scan, scans
                scans, held_bytes = [], 0
            scans += piece
            held_bytes += size_bytes
        if kind is not Scan:
            yield from ((kind, [message]) for message in messages)
    if scans:
        yield Scan, scans


def _pieces(messages: list[McapMessage]) -> Iterator[tuple[int, list[McapMessage]]]:
    """Some at a time with the bytes of their data, large ones one by one."""
    for start in range(0, len(messages), PIECE_SCANS):
        piece = messages[start : start + PIECE_SCANS]
        size_bytes, _ = extent(piece)
        if size_bytes <= BLOCK_BYTES:
            yield size_bytes, piece
        else:
            yield from ((len(message.data), [message]) for message in piece)


def _block(messages: list[McapMessage]) -> ScanBlock | None:
    """Scans as columns, if their messages are valid and have the same layout."""
    try:
        return scan_block([message.data for message in messages])
    except WireError:
        return None


def read_bag(
    directory: Path | str,
    types: Iterable[type] | None = None,
    namespace: str | None = None,
    losses: list[str] | None = None,
) -> Iterator[tuple[int, Record]]:
    """Log times in ns and records of a bag, in log order.

    Parameters
    ----------
    directory
        Folder of a bag (MCAP or SQLite storage), or one .mcap file.
    types
        Record types wanted; all by default.
    namespace
        Namespace of the stand, if the bag contains several.
    losses
        List to which descriptions of unreadable parts are appended.

    Raises
    ------
    RecordingError
        There is no bag, or no flea_diag topic in it.
    """
    reader = BagReader(directory)
    yield from reader.records(types, namespace)
    if losses is not None:
        losses += reader.losses


def sources_of(path: Path, losses: list[str], stated: dict[str, int] | None = None) -> list[Any]:
    """Files of a bag, each with its channels and messages; losses are appended.

    ``stated`` takes the messages by topic that its description counts.
    """
    if path.exists() and not path.is_dir():
        if path.name.endswith(SQLITE_ENDINGS):
            return [SqliteSource(path.parent, _of_sqlite([path.name]))]
        return [McapScan(path)]
    if not path.exists():
        raise missing(path)
    refuse_closed(path)
    known = described(path, losses) or BagDescription()
    if stated is not None:
        stated.update(known.counts)
    if known.storage == "sqlite3":
        return [SqliteSource(path, known)]
    files = [path / Path(name).name for name in known.files if name.endswith(".mcap")]
    files = files or sorted(path.glob("*.mcap"))
    if not files:
        names = sorted(f.name for f in path.iterdir() if f.name.endswith(SQLITE_ENDINGS))
        if names:
            return [SqliteSource(path, _of_sqlite(names))]
        raise RecordingError(
            f"{path} is not a bag: it has neither {METADATA_FILE} nor a file .mcap or .db3"
        )
    losses += [f"{file.name} is missing" for file in files if not file.exists()]
    return [McapScan(file) for file in files if file.exists()]


SQLITE_ENDINGS = (".db3", ".db3.zstd")


def _of_sqlite(names: list[str]) -> BagDescription:
    """Description of files without metadata.yaml: packed as a whole where their names say so."""
    packed = "file" if all(name.endswith(".zstd") for name in names) else ""
    return BagDescription(storage="sqlite3", files=tuple(names), compression=packed)
