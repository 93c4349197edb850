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

"""Decodes many scans at once: messages that differ in stamps and values only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.messages import gate
from flea_diag.wire.messages.cdr import ENCAPSULATION, TRAILING, CdrReader
from flea_diag.wire.records import SECOND_NS

STAMP = slice(len(ENCAPSULATION), len(ENCAPSULATION) + 8)
EMPTY = 8
"""Bytes of the counts of velocity and effort, both empty."""


def scan_block(messages: Sequence[bytes]) -> ScanBlock | None:
    """Scans of JointState messages as columns, in order.

    None if their layouts differ: the caller then has to read them one by one.

    Raises
    ------
    WireError
        The first message cannot be read.
    """
    reader = CdrReader(messages[0])
    reader.stamp_ns()
    channels = reader.texts()
    count = reader.count(8)
    if count:
        reader.align(8)
    start, size = reader.place, len(messages[0])
    end = start + 8 * count
    if gate.twice(channels):
        return None
    if count != len(channels) or not 0 <= size - end - EMPTY <= TRAILING:
        return None
    if {*map(len, messages)} != {size}:
        return None
    table = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(-1, size)
    alike = (table[:, STAMP.stop : start] == table[0, STAMP.stop : start]).all()
    stamps = np.ascontiguousarray(table[:, STAMP]).view(np.dtype([("s", "<i4"), ("ns", "<u4")]))
    sound = (table[:, : STAMP.start] == table[0, : STAMP.start]).all()
    sound &= not table[:, end : end + EMPTY].any()
    sound &= bool(((stamps["ns"] < SECOND_NS) & (stamps["s"] >= 0)).all())
    if not alike or not sound:
        return None
    stamps_ns = stamps["s"].astype(np.int64) * SECOND_NS + stamps["ns"]
    values = np.ascontiguousarray(table[:, start:end]).view("<f8")
    return ScanBlock(stamps_ns[:, 0], channels, values.astype(np.float64, copy=False))
