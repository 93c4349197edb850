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

"""Judgements as bytes: the rows of a record as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from typing import Any

from flea_diag.errors import WireError
from flea_diag.wire.messages.cdr import CdrReader, CdrWriter
from flea_diag.wire.messages.judgement import Status, record_of, statuses
from flea_diag.wire.records import Level

_STATUS_LEAST_BYTES = 17
_KEY_VALUE_LEAST_BYTES = 8


def encode(record: Any, stand: str) -> bytes:
    """CDR bytes of a judgement; ``stand`` is the stand's name where the record has none."""
    rows = statuses(record, getattr(record, "stand", stand))
    writer = CdrWriter(record.stamp_ns)
    writer.u32(len(rows))
    for level, name, message, hardware_id, values in rows:
        writer.u8(level)
        for text in (name, message, hardware_id):
            writer.text(text)
        writer.u32(len(values))
        for pair in values:
            for text in pair:
                writer.text(text)
    return bytes(writer)


def decode(record_type: type, reader: CdrReader) -> Any:
    """Read a judgement."""
    stamp_ns = reader.stamp_ns()
    rows = [_status(reader) for _ in range(reader.count(_STATUS_LEAST_BYTES))]
    reader.end()
    return record_of(record_type, stamp_ns, rows)


def _status(reader: CdrReader) -> Status:
    level = reader.u8()
    if level > max(Level):
        raise WireError(f"status level {level} is above its limit {int(max(Level))}")
    name, message, hardware_id = reader.text(), reader.text(), reader.text()
    count = reader.count(_KEY_VALUE_LEAST_BYTES)
    values = tuple((reader.text(), reader.text()) for _ in range(count))
    return Status(level, name, message, hardware_id, values)
