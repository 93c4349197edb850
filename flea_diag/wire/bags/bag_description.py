"""What metadata.yaml says of a bag, as far as this program uses it, checked field by field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags.bag_layout import METADATA_FILE
from flea_diag.wire.regular_file import read_bytes
from flea_diag.wire.yaml_text import parse_yaml

LARGEST_BYTES = 1 << 20
MOST_MESSAGES = 2**63 - 1


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
    top = _mapping(content, "the file")
    known = _mapping(top.get("rosbag2_bagfile_information"), "rosbag2_bagfile_information")
    name = "topics_with_message_count"
    rows = [_mapping(row, name) for row in _list(known.get(name), name)]
    files = _list(known.get("relative_file_paths"), "relative_file_paths")
    version = known.get("version")
    return BagDescription(
        None if version is None else _count(version, "version"),
        _text(known.get("storage_identifier", ""), "storage_identifier"),
        tuple(_text(name, "relative_file_paths") for name in files),
        _compression(known),
        dict(_topic(row) for row in rows if "topic_metadata" in row),  # else of no topic
    )


def _compression(known: Mapping[str, Any]) -> str:
    mode = _text(known.get("compression_mode") or "", "compression_mode").lower()
    return "" if mode == "none" else mode


def _topic(row: Mapping[str, Any]) -> tuple[str, int]:
    topic = _mapping(row["topic_metadata"], "topic_metadata")
    return _text(topic.get("name"), "name"), _count(row.get("message_count"), "message_count")


def _mapping(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise RecordingError(f"{name} = {shown(value)} must be a mapping")
    return value


def _list(value: Any, name: str) -> list[Any]:
    """A list; nothing is an empty one."""
    if value is not None and not isinstance(value, list):
        raise RecordingError(f"{name} = {shown(value)} must be a list")
    return value or []


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise RecordingError(f"{name} = {shown(value)} must be a text")
    return value


def _count(value: Any, name: str) -> int:
    if type(value) is not int or not 0 <= value <= MOST_MESSAGES:
        raise RecordingError(f"{name} = {shown(value)} must be a whole number from 0 on")
    return value
