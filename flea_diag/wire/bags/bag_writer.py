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

"""Writes records to a bag that survives a crash of its writer.

The Writer of the mcap library produces the format; this module adds rosbag2's layout and
finalises the bag once a second: chunk finished, provisional end of file written, data flushed to
disk, metadata.yaml replaced atomically. After ``kill -9`` the bag is valid and lacks at most the
last second.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags import bag_layout as layout
from flea_diag.wire.bags.bag_segment import BagSegment
from flea_diag.wire.blocks import Block, singly
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.records import Record
from flea_diag.wire.topics import TOPIC_OF, Topic
from flea_diag.wire.whole_file import new_folder


@dataclass(frozen=True)
class BagSplit:
    """Size and duration at which a bag starts a new file; 0 is never."""

    size_bytes: int = 0
    duration_s: float = 0.0

    def due(self, segment: BagSegment, log_ns: int) -> bool:
        """Whether the next message, of this log time, starts a new file."""
        long_ns = log_ns - segment.span.start_ns
        started = any(segment.span.counts.values())
        return started and (
            0 < self.size_bytes <= segment.size_bytes or 0 < self.duration_s * 1e9 <= long_ns
        )


class BagWriter:
    """Write one bag; a context manager.

    Parameters
    ----------
    directory
        Folder to create; it must not exist, or be empty.
    namespace
        Namespace of the topics of ``write`` (``stand_b``); empty for the first stand.
    stand
        Name of the stand for the hardware id of judgements.
    whole_every_s
        Wall time between two ``make_whole``; None leaves it to the caller and to ``close``,
        so that equal records give equal bytes.
    split
        When to start a new file; a full file is finished with its index.
    called
        Name of the bag in errors, where it is moved once it is whole.

    Raises
    ------
    RecordingError
        The folder is in use, the disk is full, or a record cannot be written.
    """

    def __init__(
        self,
        directory: Path | str,
        *,
        namespace: str = "",
        stand: str = "stand",
        whole_every_s: float | None = 1.0,
        split: BagSplit = BagSplit(),
        called: Path | None = None,
    ) -> None:
        self.directory = Path(directory)
        self._called = called or self.directory
        self.stand = stand
        self._namespace = layout.checked_namespace(namespace)
        self._whole_every_s = whole_every_s
        self._split = split
        self._topics: dict[str, layout.TopicEntry] = {}
        self._full: list[tuple[str, layout.Span]] = []
        self._attachments: dict[str, str] = {}
        self._number = 0
        self.losses: list[str] = []
        """Files that were removed or truncated while they were written, in words."""
        self._open()
        self._whole_at = time.monotonic()

    @property
    def path(self) -> Path:
        """The MCAP file being written."""
        return self.directory / f"{self.directory.resolve().name}_{self._number}.mcap"

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by full topic name."""
        spans = [span for _, span in self._files()]
        return {name: sum(span.counts.get(name, 0) for span in spans) for name in self._topics}

    def _files(self) -> list[tuple[str, layout.Span]]:
        return [*self._full, (self._segment.path.name, self._segment.span)]

    def _open(self) -> None:
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            if any(self.directory.iterdir()):
                raise RecordingError(
                    f"{self.directory} is not empty: a bag needs a new or empty folder"
                )
            self._segment = BagSegment(self.path)
        except OSError as error:
            raise self._refusal(error) from error

    def _refusal(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot write bag {self._called}: {error.strerror or error}")

    def write(self, record: Record, log_ns: int | None = None) -> None:
        """Write a record; ``log_ns`` is its time of receipt (default: its own stamp)."""
        topic = TOPIC_OF[type(record)]
        name = layout.absolute(topic, self._namespace)
        self._add(name, topic, encode(record, self.stand), record.stamp_ns, log_ns)

    def write_all(self, records: Iterable[Record | Block]) -> int:
        """Write records in this order, which the file keeps: log times never decrease; a count."""
        count = log_ns = 0
        for record in singly(records):
            log_ns = max(log_ns, record.stamp_ns)
            self.write(record, log_ns)
            count += 1
        return count

    def write_raw(self, topic: str, data: bytes, stamp_ns: int, log_ns: int | None = None) -> None:
        """Write the CDR bytes of a message on a flea_diag topic, by its full name.

        Raises
        ------
        RecordingError
            The topic is not a flea_diag topic.
        """
        found = layout.split_name(topic)
        if found is None:
            raise RecordingError(f"topic {shown(topic)} is not listed in flea_diag.wire.topics")
        self._add(topic, found[1], data, stamp_ns, log_ns)

    def _add(self, name: str, topic: Topic, data: bytes, stamp_ns: int, log_ns: int | None) -> None:
        log_ns = stamp_ns if log_ns is None else log_ns
        if log_ns < 0 or stamp_ns < 0:
            raise RecordingError(f"{name}: stamp {min(stamp_ns, log_ns)} ns is before 1970")
        try:
            if self._split.due(self._segment, log_ns):
                self._go_on_in_another_file()
            self._segment.add(name, topic, data, stamp_ns, log_ns)
            if name not in self._topics:
                self._topics[name] = layout.entry_of(topic)
            if self._due():
                self.make_whole()
        except OSError as error:
            raise self._refusal(error) from error

    def _go_on_in_another_file(self) -> None:
        full = self._segment
        full.finish(self._metadata_text())
        full.close()
        self._full.append((full.path.name, full.span))
        self._begin_another()

    def _begin_another(self) -> None:
        self._number += 1
        self._segment = BagSegment(self.path)
        for name, text in self._attachments.items():
            self._segment.attach(name, text.encode())

    def _replace_lost(self) -> None:
        """Go on in another file, and say so, where somebody has taken this one away."""
        what, lost = self._segment.gone, sum(self._segment.span.counts.values())
        if not what:
            return
        self.losses.append(
            f"{self._segment.path} was {what} while it was recorded: {lost} messages are lost"
        )
        self._segment.close()
        self.directory.mkdir(parents=True, exist_ok=True)
        self._begin_another()

    def attach(self, name: str, text: str) -> None:
        """Attach a text, such as a calibration, to each file of the bag (MCAP attachment)."""
        self._attachments[name] = text
        self._segment.attach(name, text.encode())

    def _due(self) -> bool:
        if self._whole_every_s is None:
            return False
        return time.monotonic() - self._whole_at >= self._whole_every_s

    def make_whole(self) -> None:
        """Flush everything written so far to disk as a valid bag."""
        self._whole_at = time.monotonic()
        if not self._topics:
            return  # ros2 bag play hangs on a metadata.yaml without topics
        try:
            self._replace_lost()
            self._segment.make_whole()
            layout.replace_metadata(self.directory, self._metadata())
        except OSError as error:
            raise self._refusal(error) from error

    def _metadata(self) -> dict[str, Any]:
        return layout.metadata(self._files(), self._topics)

    def _metadata_text(self) -> str:
        text: str = yaml.safe_dump(self._metadata(), sort_keys=False)
        return text

    def close(self) -> None:
        """Finish the bag with its index; a bag without messages is removed."""
        if self._segment.closed:
            return
        try:
            if self._topics:
                self._replace_lost()
                self._segment.finish(self._metadata_text())
                layout.replace_metadata(self.directory, self._metadata())
            else:
                self._segment.discard()
                self.directory.rmdir()
        except OSError as error:
            raise self._refusal(error) from error
        finally:
            self._segment.close()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def new_bag(directory: Path, stand: str = "stand") -> Iterator[BagWriter]:
    """Write a bag, of equal bytes for equal records; whatever is raised leaves nothing of it.

    Raises
    ------
    RecordingError
        The folder is in use, or cannot be written.
    """
    try:
        with (
            new_folder(directory) as fresh,
            BagWriter(fresh, stand=stand, whole_every_s=None, called=directory) as bag,
        ):
            yield bag
    except FileExistsError:
        raise RecordingError(
            f"{directory} is not empty: a bag needs a new or empty folder"
        ) from None
    except OSError as error:
        raise RecordingError(f"cannot write bag {directory}: {error.strerror or error}") from error
