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

"""Layout of a bag: topic names with namespace, QoS, metadata.yaml of rosbag2.

The layout is version 9 of rosbag2 (ROS 2 Jazzy): a folder with ``<folder>_0.mcap`` and a
metadata.yaml that lists topics, types, type hashes, QoS and message counts.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.topics import TOPICS, Topic
from flea_diag.wire.whole_file import replace_file

VERSION = 9
DISTRIBUTION = "jazzy"
METADATA_FILE = "metadata.yaml"

_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")
_INFINITE = {"sec": 9223372036, "nsec": 854775807}
"""Unset QoS duration, as rosbag2 writes it."""


class MessageType(NamedTuple):
    """Definition with all its dependencies (ros2msg) and RIHS01 hash of a message type."""

    definition: str
    type_hash: str


@lru_cache(maxsize=1)
def _typestore() -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise RecordingError(f"bags need the package rosbags: pip install rosbags ({error})") from (
            error
        )
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=8)
def message_type(message: str) -> MessageType:
    """Look up definition and hash of a message type of ROS 2 Jazzy."""
    definition, _ = _typestore().generate_msgdef(message, ros_version=2)
    return MessageType(definition, _typestore().hash_rihs01(message))


def refuse_closed(folder: Path) -> None:
    """Refuse a folder without read permission, which would otherwise look empty.

    Raises
    ------
    RecordingError
        The folder exists but cannot be read.
    """
    if folder.is_dir() and not os.access(folder, os.R_OK | os.X_OK):
        raise RecordingError(f"cannot read {folder}: Permission denied")


def absolute(topic: Topic, namespace: str) -> str:
    """Full name of a topic under a namespace (``/stand_b`` or empty)."""
    return topic.name if topic.name.startswith("/") else f"{namespace}/{topic.name}"


def checked_namespace(namespace: str) -> str:
    """Namespace with its leading slash and no trailing one.

    Raises
    ------
    RecordingError
        It is not a ROS namespace.
    """
    full = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    if not _NAMESPACE.fullmatch(full):
        raise RecordingError(
            f"namespace {shown(namespace)} is not a ROS name: use letters, digits and _ between "
            "slashes, no leading digit"
        )
    return full


@lru_cache(maxsize=1024)
def split_name(name: str) -> tuple[str, Topic] | None:
    """Namespace and table row of a flea_diag topic by its full name; None for any other topic."""
    for topic in TOPICS:
        if name == absolute(topic, ""):
            return "", topic
        if not topic.name.startswith("/") and name.endswith(f"/{topic.name}"):
            return name[: -len(topic.name) - 1], topic
    return None


def quality_of_service(topic: Topic) -> dict[str, Any]:
    """QoS offered by the publishers of a topic, in rosbag2's terms."""
    return {
        "history": "keep_last",
        "depth": topic.depth,
        "reliability": "reliable",
        "durability": "transient_local" if topic.latched else "volatile",
        "deadline": dict(_INFINITE),
        "lifespan": dict(_INFINITE),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_INFINITE),
        "avoid_ros_namespace_conventions": False,
    }


class TopicEntry(NamedTuple):
    """Entry of one topic in metadata.yaml; ``qos`` is a list of profiles."""

    message: str
    type_hash: str
    qos: list[dict[str, Any]]


def entry_of(topic: Topic) -> TopicEntry:
    """Entry of a flea_diag topic."""
    type_hash = message_type(topic.message).type_hash
    return TopicEntry(topic.message, type_hash, [quality_of_service(topic)])


class Span(NamedTuple):
    """Message counts by topic, and the range of their log times in ns."""

    counts: dict[str, int]
    start_ns: int
    end_ns: int

    def with_message(self, name: str, log_ns: int) -> Span:
        """Add one message of a topic."""
        first = not any(self.counts.values())
        self.counts[name] += 1
        start_ns = log_ns if first else min(self.start_ns, log_ns)
        return Span(self.counts, start_ns, max(self.end_ns, log_ns))


def metadata(files: Sequence[tuple[str, Span]], topics: dict[str, TopicEntry]) -> dict[str, Any]:
    """Content of metadata.yaml for a bag of one or more files; ``topics`` by full name."""
    spans = [span for _, span in files]
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [name for name, _ in files],
        **_times(_whole(spans)),
        "topics_with_message_count": [
            {
                "topic_metadata": _topic_metadata(name, entry),
                "message_count": sum(span.counts.get(name, 0) for span in spans),
            }
            for name, entry in topics.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": name, **_times(span)} for name, span in files],
        "custom_data": None,
        "ros_distro": DISTRIBUTION,
    }


def _whole(spans: Sequence[Span]) -> Span:
    """Span of all files; a file without messages has no times."""
    told = [span for span in spans if any(span.counts.values())] or list(spans[:1])
    counts = {str(k): sum(span.counts.values()) for k, span in enumerate(told)}
    return Span(counts, min(s.start_ns for s in told), max(s.end_ns for s in told))


def _times(span: Span) -> dict[str, Any]:
    return {
        "duration": {"nanoseconds": span.end_ns - span.start_ns},
        "starting_time": {"nanoseconds_since_epoch": span.start_ns},
        "message_count": sum(span.counts.values()),
    }


def _topic_metadata(name: str, entry: TopicEntry) -> dict[str, Any]:
    return {
        "name": name,
        "type": entry.message,
        "serialization_format": "cdr",
        "offered_qos_profiles": entry.qos,
        "type_description_hash": entry.type_hash,
    }


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""The one in C where libyaml is there: a recorder writes its metadata twice a second."""


def replace_metadata(directory: Path, content: dict[str, Any]) -> None:
    """Replace metadata.yaml atomically: a reader sees either the old or the new content."""
    named = {"rosbag2_bagfile_information": content}
    text: str = yaml.dump(named, Dumper=_DUMPER, sort_keys=False)
    replace_file(directory / METADATA_FILE, text.encode(), durable=True)
