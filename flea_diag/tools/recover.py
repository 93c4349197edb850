"""``flea recover``: a bag whose recorder died, written anew with summary, index and metadata."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.tools.terminal import IN_PART, warn
from flea_diag.wire import bag_layout as layout
from flea_diag.wire.bag_layout import Span, TopicEntry
from flea_diag.wire.mcap_scan import Channel, McapScan, Message

NAME = "recover"
SUMMARY = "write a truncated bag anew, with summary, index and metadata.yaml"
EXAMPLES = """\
examples:
  flea recover bags/run                    to bags/run_recovered; the bag itself is not touched
  flea recover bags/run -o bags/whole
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("bag", type=Path, metavar="BAGDIR", help="bag, or one .mcap file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="BAGDIR", help="new bag (default: BAGDIR_recovered)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Recover one bag."""
    source: Path = arguments.bag
    target = arguments.output or source.with_name(f"{source.stem}_recovered")
    recovered = recover(source, target)
    for loss in recovered.losses:
        warn(loss)
    print(f"{target}: {recovered.messages} messages on {recovered.topics} topics")
    return IN_PART if any("no footer" not in loss for loss in recovered.losses) else 0


@dataclass(frozen=True)
class Recovered:
    """What was saved, and what was not."""

    messages: int
    topics: int
    losses: tuple[str, ...]


def recover(source: Path, target: Path) -> Recovered:
    """Copy every whole message of a bag, whoever wrote it, to a new bag.

    Raises
    ------
    RecordingError
        When there is no MCAP file, not one whole message, or the target is in use.
    """
    scans = [McapScan(file) for file in mcap_files(source)]
    copy = _Copy(target)
    for message in merged(scans):
        copy.write(message)
    losses = tuple(loss for scan in scans for loss in scan.losses)
    if not copy.span.counts:
        raise RecordingError(f"{source}: not one whole message in it, nothing to recover")
    for scan in scans:
        for name, data in scan.attachments.items():
            copy.attach(name, data)
    copy.close()
    return Recovered(sum(copy.span.counts.values()), len(copy.span.counts), losses)


def mcap_files(source: Path) -> list[Path]:
    """MCAP files of a bag, or the one file that is given.

    Raises
    ------
    RecordingError
        When there is none.
    """
    files = [source] if source.is_file() else sorted(source.glob("*.mcap"))
    if not files:
        raise RecordingError(f"{source}: no .mcap file there")
    return files


def merged(scans: list[McapScan]) -> Iterator[Message]:
    """Messages of all files in order of log time."""
    import heapq

    return heapq.merge(*(scan.messages() for scan in scans), key=lambda message: message.log_ns)


@dataclass
class _Copy:
    """A new bag, opened with its first message: a bag without one is none."""

    directory: Path
    span: Span = field(default_factory=lambda: Span({}, 0, 0))
    _topics: dict[str, TopicEntry] = field(default_factory=dict)
    _schemas: dict[str, int] = field(default_factory=dict)
    _channels: dict[str, int] = field(default_factory=dict)
    _stream: Any = None
    _writer: Any = None

    def _open(self) -> None:
        from mcap.writer import Writer

        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            if any(self.directory.iterdir()):
                raise RecordingError(f"{self.directory} is not empty, choose another with -o")
            self._stream = (self.directory / self._file).open("xb")
        except OSError as error:
            words = error.strerror or error
            raise RecordingError(f"cannot write bag {self.directory}: {words}") from error
        self._writer = Writer(self._stream)
        self._writer.start(profile="ros2", library="flea_diag recover")

    @property
    def _file(self) -> str:
        return f"{self.directory.resolve().name}_0.mcap"

    def write(self, message: Message) -> None:
        """Copy one message."""
        if self._writer is None:
            self._open()
        channel = message.channel
        number = self._channels.get(channel.topic) or self._register(channel)
        sequence = self.span.counts[channel.topic] & 0xFFFFFFFF
        self._writer.add_message(number, message.log_ns, message.data, message.publish_ns, sequence)
        self.span = self.span.with_message(channel.topic, message.log_ns)

    def _register(self, channel: Channel) -> int:
        name, encoding, data = channel.schema
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, encoding, data)
        self._channels[channel.topic] = self._writer.register_channel(
            channel.topic, channel.encoding, self._schemas[name], dict(channel.metadata)
        )
        self._topics[channel.topic] = _entry(channel)
        self.span.counts[channel.topic] = 0
        return self._channels[channel.topic]

    def attach(self, name: str, data: bytes) -> None:
        """Copy one attachment."""
        self._writer.add_attachment(self.span.end_ns, self.span.end_ns, name, "text/plain", data)

    def close(self) -> None:
        """Write summary, index and metadata.yaml."""
        self._writer.finish()
        self._stream.close()
        content = layout.metadata([(self._file, self.span)], self._topics)
        layout.replace_metadata(self.directory, content)


def _entry(channel: Channel) -> TopicEntry:
    """What the channel says of its QoS and type hash, or what we know of them."""
    import yaml

    known = dict(channel.metadata)
    ours = layout.split_name(channel.topic)
    if ours is not None and ours[1].message == channel.message:
        entry = layout.entry_of(ours[1])
    else:
        entry = TopicEntry(channel.message, "", [])
    try:
        profiles = yaml.safe_load(known.get("offered_qos_profiles", ""))
    except (yaml.YAMLError, RecursionError):
        profiles = None
    qos = profiles if isinstance(profiles, list) else entry.qos
    return TopicEntry(channel.message, known.get("topic_type_hash", entry.type_hash), qos)
