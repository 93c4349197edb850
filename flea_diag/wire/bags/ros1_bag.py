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

"""Reads a bag of ROS 1 (format 2.0, with its index) by rosbags, within the budget of a file."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags.budget import Budget
from flea_diag.wire.bags.mcap_chunk import CHUNK_LIMIT_BYTES
from flea_diag.wire.bags.mcap_message import Channel, McapMessage, Schema
from flea_diag.wire.regular_file import opened

MAGIC = b"#ROSBAG V"


class Ros1Bag:
    """One file of ROS 1; the same view of it as of an MCAP file.

    Raises
    ------
    RecordingError
        The file is damaged, has no index, or unpacks to more than its budget.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.losses: list[str] = []
        self.attachments: dict[str, bytes] = {}
        self.channels: dict[int, Channel] = {}
        with opened(path) as stream:
            size = stream.seek(0, 2)
        self._budget = Budget(path.name, size)
        self._reader: Any = self._guarded(self._open)
        for connection in self._reader.connections:
            text = connection.msgdef.data.encode()
            self._budget.keep(len(text))
            schema = Schema(connection.msgtype, "ros1msg", text)
            self.channels[connection.id] = Channel(
                connection.topic, connection.msgtype, "ros1", schema
            )

    def _open(self) -> Any:
        from lz4.frame import decompress as lz4_decompress
        from rosbags.rosbag1 import Reader

        reader = Reader(self.path)
        reader.open()
        unpack = {bz2.decompress: self._unbz2, lz4_decompress: self._unlz4}
        for place, chunk in reader.chunks.items():
            bounded = unpack.get(chunk.decompressor, self._plain)
            reader.chunks[place] = chunk._replace(decompressor=bounded)
        return reader

    def _guarded(self, read: Callable[[], Any]) -> Any:
        """Result of a step of rosbags; whatever it makes of damaged bytes is one kind of error."""
        try:
            return read()
        except RecordingError:
            raise
        except Exception as error:
            raise RecordingError(
                f"cannot read {self.path} as a bag of ROS 1: {shown(str(error))}; "
                "try rosbag reindex"
            ) from error

    def messages(self) -> Iterator[McapMessage]:
        """All messages in order of their time of receipt."""
        found = self._reader.messages()
        self._budget.resume()
        while True:
            entry = self._guarded(lambda: next(found, None))
            if entry is None:
                return
            connection, log_ns, data = entry
            self._budget.count(1)
            self._budget.spend()
            yield McapMessage(log_ns, log_ns, self.channels[connection.id], bytes(data))
            self._budget.resume()

    def _plain(self, data: bytes) -> bytes:
        self._budget.unpack(len(data))
        return data

    def _unbz2(self, data: bytes) -> bytes:
        return self._bounded(bz2.BZ2Decompressor().decompress(data, CHUNK_LIMIT_BYTES + 1))

    def _unlz4(self, data: bytes) -> bytes:
        from lz4.frame import LZ4FrameDecompressor

        return self._bounded(LZ4FrameDecompressor().decompress(data, CHUNK_LIMIT_BYTES + 1))

    def _bounded(self, data: bytes) -> bytes:
        if len(data) > CHUNK_LIMIT_BYTES:
            raise RecordingError(
                f"{self.path}: a chunk unpacks to more than {CHUNK_LIMIT_BYTES} bytes, it is not "
                "read"
            )
        self._budget.unpack(len(data))
        return data
