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

"""What a channel table of another serial number means once its source has taken over."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support import stands
from support.observer_scans import healthy

from flea_diag.wire.records import ANOTHER_UNIT, ChannelTable, Detection, Scan

S = 1_000_000_000
BEFORE = 30


def table_of(serial: str) -> ChannelTable:
    table = stands.table()
    return replace(table, channels=tuple(replace(row, serial=serial) for row in table.channels))


def closed(first: str, second: str, silent_s: float) -> list[Detection]:
    """What is closed with the first scans after the table of a second source."""
    by_ns = round(silent_s * S)
    late: list[Scan] = [
        replace(s, stamp_ns=s.stamp_ns + by_ns) for s in healthy()[BEFORE : BEFORE + 5]
    ]
    told = stands.replay(
        stands.observer(), [table_of(first), *healthy()[:BEFORE], table_of(second), *late]
    )
    return [each for each in stands.of(Detection, told) if each.test == ANOTHER_UNIT]


@pytest.mark.parametrize(
    ("first", "second", "count"), [("SN 1", "SN 1", 0), ("", "SN 2", 0), ("SN 1", "SN 2", 1)]
)
def test_another_serial_number_after_a_silence_is_another_unit(
    first: str, second: str, count: int
) -> None:
    """The same one is a driver that was started again: what was found of its machine stays."""
    found = closed(first, second, 1.5)
    assert len(found) == count
    assert all(each.stamp_ns == healthy()[BEFORE].stamp_ns + 3 * S // 2 for each in found)


def test_the_table_of_a_source_that_is_not_used_changes_nothing() -> None:
    """The first one goes on."""
    assert closed("SN 1", "SN 2", 0.0) == []
