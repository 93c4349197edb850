"""Records into a bag that survives the death of its writer.

The mcap library's Writer does the format; what is added here is rosbag2's layout and that
the bag is made whole once a second: chunk finished, file ended for now, bytes on the disk,
metadata.yaml replaced in one step. After ``kill -9`` the bag opens as it stands and lacks at
most the last second.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from flea_diag import __version__
from flea_diag.errors import RecordingError
from flea_diag.wire import bag_layout as layout
from flea_diag.wire.codec import encode
from flea_diag.wire.mcap_file import McapFile
from flea_diag.wire.records import Record
from flea_diag.wire.topics import TOPIC_OF, Topic

CHUNK_BYTES = 1 << 20
"""More than a second of most stands, so that between two ``make_whole`` nothing is written."""


class BagWriter:
    """Write one bag; a context manager.

    Parameters
    ----------
    directory
        Folder to make; it must not exist, or be empty.
    namespace
        Namespace of the topics of ``write`` (``stand_b``); empty for the first stand.
    stand
        Name of the rig for the hardware id of judgements.
    whole_every_s
        Wall time between two ``make_whole``; None leaves it to the owner and to ``close``,
        so that equal records give equal bytes.

    Raises
    ------
    RecordingError
        When the folder is in use, the disk is full, or a record cannot be written.
    """

    def __init__(
        self,
        directory: Path | str,
        *,
        namespace: str = "",
        stand: str = "stand",
        whole_every_s: float | None = 1.0,
    ) -> None:
        self.directory = Path(directory)
        self.stand = stand
        self._namespace = layout.checked_namespace(namespace)
        self._whole_every_s = whole_every_s
        self._topics: dict[str, layout.TopicEntry] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._span = layout.Span({}, 0, 0)
        self._open()
        self._whole_at = time.monotonic()

    @property
    def path(self) -> Path:
        """The MCAP file."""
        return self.directory / f"{self.directory.resolve().name}_0.mcap"

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by full topic name."""
        return dict(self._span.counts)

    def _open(self) -> None:
        try:
            from mcap.writer import Writer
        except ImportError as error:
            raise RecordingError(f"bags need the package mcap: pip install mcap ({error})") from (
                error
            )
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            if any(self.directory.iterdir()):
                raise RecordingError(
                    f"{self.directory} is not empty, a bag needs a folder to itself"
                )
            self._file = McapFile(self.path)
        except OSError as error:
            raise self._refusal(error) from error
        self._writer: Any = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros2", library=f"flea_diag {__version__}")

    def _refusal(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot write bag {self.directory}: {error.strerror or error}")

    def write(self, record: Record, log_ns: int | None = None) -> None:
        """Write a record; ``log_ns`` is when it was received (its own stamp by default)."""
        topic = TOPIC_OF[type(record)]
        name = layout.absolute(topic, self._namespace)
        self._add(name, topic, encode(record, self.stand), record.stamp_ns, log_ns)

    def write_raw(self, topic: str, data: bytes, stamp_ns: int, log_ns: int | None = None) -> None:
        """Write the CDR bytes of one of our topics, by its full name.

        Raises
        ------
        RecordingError
            When the topic is none of ours.
        """
        found = layout.split_name(topic)
        if found is None:
            raise RecordingError(f"topic {topic!r} is none of flea_diag's (flea_diag.wire.topics)")
        self._add(topic, found[1], data, stamp_ns, log_ns)

    def _add(self, name: str, topic: Topic, data: bytes, stamp_ns: int, log_ns: int | None) -> None:
        log_ns = stamp_ns if log_ns is None else log_ns
        if log_ns < 0 or stamp_ns < 0:
            raise RecordingError(f"{name}: stamp {min(stamp_ns, log_ns)} ns is before 1970")
        try:
            channel = self._channels.get(name) or self._register(name, topic)
            sequence = self._span.counts[name] & 0xFFFFFFFF
            self._writer.add_message(channel, log_ns, data, stamp_ns, sequence)
            self._span = self._span.with_message(name, log_ns)
            if self._due():
                self.make_whole()
        except OSError as error:
            raise self._refusal(error) from error

    def _register(self, name: str, topic: Topic) -> int:
        entry = layout.entry_of(topic)
        if topic.message not in self._schemas:
            self._schemas[topic.message] = self._writer.register_schema(
                topic.message, "ros2msg", layout.message_type(topic.message).definition.encode()
            )
        qos = yaml.safe_dump(entry.qos, sort_keys=False)
        self._channels[name] = self._writer.register_channel(
            name,
            "cdr",
            self._schemas[topic.message],
            {"offered_qos_profiles": qos, "topic_type_hash": entry.type_hash},
        )
        self._topics[name] = entry
        self._span.counts[name] = 0
        return self._channels[name]

    def attach(self, name: str, text: str) -> None:
        """Keep a text in the bag (a calibration, a configuration) as an MCAP attachment."""
        now_ns = self._span.end_ns
        self._writer.add_attachment(now_ns, now_ns, name, "text/plain", text.encode())

    def _due(self) -> bool:
        if self._whole_every_s is None:
            return False
        return time.monotonic() - self._whole_at >= self._whole_every_s

    def make_whole(self) -> None:
        """Put everything written so far on the disk, so that the bag opens as it stands."""
        self._whole_at = time.monotonic()
        if not self._topics:
            return  # ros2 bag play hangs on a metadata.yaml without topics
        try:
            self._writer.flush()
            self._file.end_for_now()
            layout.replace_metadata(self.directory, self._metadata())
        except OSError as error:
            raise self._refusal(error) from error

    def _metadata(self) -> dict[str, Any]:
        return layout.metadata(self.path.name, self._topics, self._span)

    def close(self) -> None:
        """Finish the bag with its index; a bag without one message is taken away again."""
        if self._file.closed:
            return
        try:
            if self._topics:
                self._finish()
            else:
                self._discard()
        except OSError as error:
            raise self._refusal(error) from error
        finally:
            self._file.close()

    def _finish(self) -> None:
        content = yaml.safe_dump(self._metadata(), sort_keys=False)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": content})
        self._writer.finish()
        self._file.sync()
        layout.replace_metadata(self.directory, self._metadata())

    def _discard(self) -> None:
        self.path.unlink()
        self.directory.rmdir()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
