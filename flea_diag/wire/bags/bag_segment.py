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

"""One file of a bag: an MCAP file that can be finalised at any time, with message counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from flea_diag import __version__
from flea_diag.errors import RecordingError
from flea_diag.wire.bags import bag_layout as layout
from flea_diag.wire.bags.bag_layout import Span
from flea_diag.wire.bags.mcap_file import McapFile
from flea_diag.wire.bags.mcap_message import Channel, McapMessage, Schema
from flea_diag.wire.topics import Topic

CHUNK_BYTES = 1 << 20
"""More than 1 s of data of most stands, so that nothing is written between two ``make_whole``."""


class BagSegment:
    """A new MCAP file in rosbag2's layout.

    Raises
    ------
    RecordingError
        The package mcap is not installed.
    OSError
        The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        try:
            from mcap.writer import Writer
        except ImportError as error:
            raise RecordingError(f"bags need the package mcap: pip install mcap ({error})") from (
                error
            )
        self.path = path
        self.span = Span({}, 0, 0)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._waiting_bytes = 0
        self._file = McapFile(path)
        self._writer: Any = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros2", library=f"flea_diag {__version__}")

    @property
    def size_bytes(self) -> int:
        """Bytes so far, including those not written yet."""
        return self._file.tell() + self._waiting_bytes

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    @property
    def gone(self) -> str:
        """What somebody has done to the file meanwhile; empty: nothing."""
        return self._file.gone(self.path)

    def add(self, name: str, topic: Topic, data: bytes, stamp_ns: int, log_ns: int) -> None:
        """Write one message of a flea_diag topic."""
        if name not in self._channels:
            self._register(_channel(name, topic))
        self._put(name, data, stamp_ns, log_ns)

    def copy(self, message: McapMessage) -> None:
        """Copy one message of any topic from another file."""
        name = message.channel.topic
        if name not in self._channels:
            self._register(message.channel)
        self._put(name, message.data, message.publish_ns, message.log_ns)

    def _put(self, name: str, data: bytes, stamp_ns: int, log_ns: int) -> None:
        sequence = self.span.counts[name] & 0xFFFFFFFF
        before = self._file.tell()
        self._writer.add_message(self._channels[name], log_ns, data, stamp_ns, sequence)
        grown = self._file.tell() > before
        self._waiting_bytes = 0 if grown else self._waiting_bytes + len(data)
        self.span = self.span.with_message(name, log_ns)

    def _register(self, channel: Channel) -> None:
        schema, encoding, definition = channel.schema
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(schema, encoding, definition)
        self._channels[channel.topic] = self._writer.register_channel(
            channel.topic, channel.encoding, self._schemas[schema], dict(channel.metadata)
        )
        self.span.counts[channel.topic] = 0

    def attach(self, name: str, data: bytes) -> None:
        """Attach a text."""
        now_ns = self.span.end_ns
        self._writer.add_attachment(now_ns, now_ns, name, "text/plain", data)

    def make_whole(self) -> None:
        """Flush everything so far to disk as a valid MCAP file."""
        self._writer.flush()
        self._file.end_for_now()
        self._waiting_bytes = 0

    def finish(self, metadata: str) -> None:
        """Write metadata, summary and index, and flush them to disk."""
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
        self._writer.finish()
        self._file.finish()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def discard(self) -> None:
        """Close and remove the file."""
        self.close()
        self.path.unlink()


def _channel(name: str, topic: Topic) -> Channel:
    """Channel of a flea_diag topic, under its full name."""
    entry = layout.entry_of(topic)
    definition = layout.message_type(topic.message).definition.encode()
    qos = yaml.safe_dump(entry.qos, sort_keys=False)
    return Channel(
        name,
        topic.message,
        "cdr",
        Schema(topic.message, "ros2msg", definition),
        (("offered_qos_profiles", qos), ("topic_type_hash", entry.type_hash)),
    )
