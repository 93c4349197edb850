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

"""What metadata.yaml says of a bag, as far as this program uses it, checked field by field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import Count
from flea_diag.wire.bags.bag_layout import METADATA_FILE
from flea_diag.wire.regular_file import read_bytes
from flea_diag.wire.yaml_text import parse_yaml

LARGEST_BYTES = 1 << 20


@dataclass(frozen=True)
class BagDescription:
    """Fields of rosbag2's description that are used; what it does not say has its default."""

    version: int | None = None
    storage: str = ""
    files: tuple[str, ...] = ()
    compression: str = ""
    """What is compressed: ``file``, ``message``, or nothing."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Messages by topic."""


def described(path: Path, losses: list[str]) -> BagDescription | None:
    """Read metadata.yaml; None where it is missing or broken, for a bag may do without."""
    file = path / METADATA_FILE
    try:
        return description(parse_yaml(read_bytes(file, LARGEST_BYTES).decode("utf-8")))
    except FileNotFoundError:
        losses.append(f"{METADATA_FILE} is missing")
    except UnicodeDecodeError:
        losses.append(f"{METADATA_FILE} is unreadable: not a text file")
    except OSError as error:
        losses.append(f"{METADATA_FILE} is unreadable: {error.strerror}")
    except (ValueError, RecordingError) as error:
        losses.append(f"{METADATA_FILE} is unreadable: {error}")
    return None


def description(content: Any) -> BagDescription:
    """Description of what metadata.yaml held.

    Raises
    ------
    RecordingError
        Naming the field, its value and what it must be.
    """
    known = read_as(
        _MetadataFile, content, error=RecordingError, strict=False
    ).rosbag2_bagfile_information
    mode = (known.compression_mode or "").lower()
    return BagDescription(
        known.version,
        known.storage_identifier,
        known.relative_file_paths or (),
        "" if mode == "none" else mode,
        {row.topic_metadata.name: row.message_count
         for row in known.topics_with_message_count or () if row.topic_metadata},
    )  # fmt: skip


@dataclass(frozen=True)
class _Topic:
    name: str


@dataclass(frozen=True)
class _TopicCount:
    topic_metadata: _Topic | None = None
    message_count: Count = 0


@dataclass(frozen=True)
class _Information:
    """The fields that are used, as rosbag2 names them."""

    version: Count | None = None
    storage_identifier: str = ""
    relative_file_paths: tuple[str, ...] | None = ()
    compression_mode: str | None = ""
    topics_with_message_count: tuple[_TopicCount, ...] | None = ()


@dataclass(frozen=True)
class _MetadataFile:
    rosbag2_bagfile_information: _Information
