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

"""Messages that are well formed and wrong: refused where bytes become records, live and in bags."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flea_diag.errors import WireError
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.messages import codec

NOW_NS = 1_700_000_000 * 10**9
SCAN = r.Scan(NOW_NS, ("motor_current", "motor_voltage"), (1.0, 2.0))
CANDIDATE = r.Candidate("jam", "friction+", 1.0, "fits")
GROUP = r.AmbiguityGroup(
    NOW_NS, r.Outcome.ISOLATED, 1, 1, 1, (CANDIDATE,), (), NOW_NS, "the fault is jam", "", "live"
)
CHANNEL = r.ChannelInfo("motor_current", "A", -10.0, 10.0, 100.0)

WRONG: dict[str, r.Record] = {
    "a channel twice in a scan": replace(SCAN, channels=("motor_current",) * 2),
    "a scan before 1970": replace(SCAN, stamp_ns=-1),
    "a scan long before 1970": replace(SCAN, stamp_ns=-(2**31) * 10**9),
    "a channel twice in the table": r.ChannelTable(NOW_NS, "s", (CHANNEL, CHANNEL)),
    "a table before 1970": r.ChannelTable(-5, "s", (CHANNEL,)),
    "an axis twice": r.VibrationBlock(NOW_NS, ("x", "x"), 0, b""),
    "an axis twice in its levels": r.VibrationLevel(NOW_NS, ("x", "x"), (1.0, 2.0)),
    "a residual twice": r.Residual(NOW_NS, ("a", "a"), (1.0, 2.0), (0.0, 0.0), (1.0, 1.0)),
    "a regressor twice": r.Residual(NOW_NS, (), (), (), (), ("v", "v"), (1.0, 2.0)),
    "a symbol twice": r.Symbols(NOW_NS, 1, (r.Symbol("a", "+", "0", 1),) * 2),
    "a fault possible and dropped": replace(GROUP, dropped=(CANDIDATE,)),
    "a verdict before 1970": replace(GROUP, stamp_ns=-1),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_contradicts_itself_is_refused_with_its_name(name: str) -> None:
    record = WRONG[name]
    data = codec.encode(record)
    with pytest.raises(WireError) as refused:
        codec.decode(type(record), data)
    words = str(refused.value)
    assert words.startswith(type(record).__name__)
    assert "twice" in words or "before 1970" in words
    assert "\n" not in words


@pytest.mark.parametrize("record", [SCAN, GROUP], ids=["scan", "group"])
def test_what_is_sound_passes(record: Any) -> None:
    assert repr(codec.decode(type(record), codec.encode(record))) == repr(record)  # sizes are NaN


@pytest.mark.parametrize("count", [1, 50])
def test_a_bag_of_scans_with_a_channel_twice_says_so(count: int, tmp_path: Path) -> None:
    """Read one by one and as columns: the later value does not win in silence."""
    wrong = WRONG["a channel twice in a scan"]
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(count):
            bag.write(replace(wrong, stamp_ns=NOW_NS + number))
    for read in ("records", "blocks"):
        reader = BagReader(tmp_path / "bag")
        assert list(getattr(reader, read)()) == []
        assert f"{count} unreadable messages" in reader.losses[-1]
        assert "'motor_current' occurs twice" in reader.losses[0]
