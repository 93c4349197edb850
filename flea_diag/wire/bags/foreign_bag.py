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

"""Messages of any type from the bags of any recorder: rosbag2 in MCAP or SQLite, and ROS 1.

A type is that of the message definition in the bag, or, where a bag holds none, that of ROS 2
Jazzy's common interfaces.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags.bag_reader import sources_of
from flea_diag.wire.bags.controller_types import controller_types
from flea_diag.wire.bags.mcap_message import Channel
from flea_diag.wire.bags.ros1_bag import MAGIC, Ros1Bag
from flea_diag.wire.regular_file import opened

LONGEST_DEFINITION = 100_000
"""Bytes of a message definition with all that it needs."""
MOST_UNREADABLE = 0.05
"""Share of the messages of a topic that may be unreadable."""
_FORMATS = {"": "cdr", "cdr": "cdr", "ros1": "ros1"}


class ForeignMessage(NamedTuple):
    """One message: its topic without leading slash, time of receipt, and content by fields."""

    topic: str
    log_ns: int
    content: Any


class ForeignBag:
    """One bag of any recorder.

    Attributes
    ----------
    topics
        Every topic without leading slash, with its message type.
    losses
        Descriptions of unreadable parts; complete once ``messages`` has been read to its end.

    Raises
    ------
    RecordingError
        There is no bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.losses: list[str] = []
        self._sources = [Ros1Bag(path)] if _is_ros1(path) else sources_of(path, self.losses)
        channels = [c for source in self._sources for c in source.channels.values()]
        self.topics = {c.topic.lstrip("/"): c.message for c in channels if c.encoding in _FORMATS}
        self._decoders: dict[Channel, Any] = {}

    def messages(self, topics: Collection[str]) -> Iterator[ForeignMessage]:
        """Messages of these topics, in order of receipt within each file.

        Raises
        ------
        RecordingError
            A type is unknown, or too many messages cannot be read.
        """
        read, unreadable = dict.fromkeys(topics, 0), dict.fromkeys(topics, 0)
        for source in self._sources:
            for message in source.messages():
                topic = message.channel.topic.lstrip("/")
                if topic not in read:
                    continue
                read[topic] += 1
                content = self._decoded(message.channel, message.data)
                if content is None:
                    unreadable[topic] += 1
                else:
                    yield ForeignMessage(topic, message.log_ns, content)
            self.losses += [loss for loss in source.losses if loss not in self.losses]
        for topic, count in unreadable.items():
            if count > MOST_UNREADABLE * read[topic]:
                raise RecordingError(
                    f"{self.path}: {count} of {read[topic]} messages on {shown(topic)} cannot be "
                    f"read as {self.topics[topic]}, at most {MOST_UNREADABLE:.0%} may be damaged"
                )
            if count:
                self.losses.append(f"{topic}: {count} unreadable messages")

    def unreadable(self) -> dict[str, str]:
        """Topics whose types nobody defines, each with the reason."""
        found: dict[str, str] = {}
        for source in self._sources:
            for channel in source.channels.values():
                if channel.encoding not in _FORMATS or channel in self._decoders:
                    continue
                try:
                    self._decoders[channel] = _decoder(channel, self.path)
                except RecordingError as error:
                    found[channel.topic.lstrip("/")] = str(error)
        return found

    def _decoded(self, channel: Channel, data: bytes) -> Any:
        """Content of a message; None if it is unreadable."""
        decode = self._decoders.get(channel)
        if decode is None:
            decode = self._decoders[channel] = _decoder(channel, self.path)
        try:
            return decode(data, channel.message)
        except Exception:  # whatever the generated code of rosbags makes of damaged bytes
            return None


def _is_ros1(path: Path) -> bool:
    if not path.is_file():
        return False
    try:
        with opened(path) as stream:
            return stream.read(len(MAGIC)) == MAGIC
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error


def _decoder(channel: Channel, path: Path) -> Any:
    """Function of rosbags that makes content of the bytes of a channel's messages."""
    from rosbags.typesys import Stores, get_typestore

    known = get_typestore(Stores.ROS1_NOETIC if channel.encoding == "ros1" else Stores.ROS2_JAZZY)
    defined = _definitions(channel, path) or controller_types(channel.message, known)
    store = known
    if channel.message not in known.fielddefs or any(
        known.fielddefs.get(name) != definition for name, definition in defined.items()
    ):
        store = get_typestore(Stores.EMPTY)
        store.register({n: found for n, found in defined.items() if n not in store.fielddefs})
    if channel.message not in store.fielddefs:
        raise RecordingError(
            f"{path}: {shown(channel.topic)} is of the type {shown(channel.message)}, which the "
            "bag does not define and neither ROS 2's common interfaces nor control_msgs hold: "
            "record it as MCAP, which keeps the definition, or convert the bag where the type is "
            "known (ros2 bag convert)"
        )
    return store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr


def _definitions(channel: Channel, path: Path) -> Any:
    """Types that the bag defines for a channel, by name."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    schema = channel.schema
    if not schema.data:
        return {}
    if len(schema.data) > LONGEST_DEFINITION:
        raise RecordingError(
            f"{path}: the definition of {shown(channel.message)} has {len(schema.data)} bytes, at "
            f"most {LONGEST_DEFINITION} are read"
        )
    text = schema.data.decode(errors="replace")
    try:
        if schema.encoding == "ros2idl":
            return get_types_from_idl(text)
        return get_types_from_msg(text, channel.message)
    except Exception as error:  # of a parser of other people's text
        raise RecordingError(
            f"{path}: the definition of {shown(channel.message)} cannot be read: "
            f"{shown(str(error))}"
        ) from error
