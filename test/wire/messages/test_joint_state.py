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

"""A message read by the form of the one before is read as if it were the first."""

from __future__ import annotations

import math

import pytest

from flea_diag.errors import WireError
from flea_diag.wire.blocks import block_of
from flea_diag.wire.messages import codec, joint_state
from flea_diag.wire.messages.joint_state import MOST_NAMES
from flea_diag.wire.records import Residual, Scan, VibrationLevel

RECORDS = (
    Scan(7_000_000_001, ("motor_current", "load_force"), (1.5, -20.0)),
    Scan(7_000_000_001, (), ()),
    VibrationLevel(3_000_000_000, ("motor_x", "nut_x"), (0.5, 0.25), (3.0, 3.5)),
    Residual(2_000_000_000, ("a", "b"), (1.0, 2.0), (0.5, 0.25), (5.0, 6.0), ("u",), (3.0,),
             ("x",), (9.0,), (0.125,), (50.0, 1.0, 0.0)),
)  # fmt: skip


def outcome(kind: type, data: bytes) -> str:
    """What reading these bytes gives, or why they are refused."""
    try:
        return repr(codec.decode(kind, data))
    except WireError as error:
        return str(error)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_a_byte_changed_in_a_repeated_message_has_the_same_effect_as_in_the_first(record) -> None:
    kind, sound = type(record), codec.encode(record)
    for place in range(len(sound)):
        changed = bytearray(sound)
        changed[place] ^= 0x81
        joint_state._READ.clear()
        alone = outcome(kind, bytes(changed))
        joint_state._READ.clear()
        assert outcome(kind, sound) == repr(record)
        assert outcome(kind, bytes(changed)) == alone


def test_names_of_a_repeated_message_are_not_read_again() -> None:
    first, second = (codec.encode(Scan(stamp, ("a", "b"), (1.0, 2.0))) for stamp in (1, 2))
    assert codec.decode(Scan, first).channels is codec.decode(Scan, second).channels


def test_more_sizes_than_are_kept_are_read_all_the_same() -> None:
    for count in (*range(2 * joint_state._MOST_READ), 3):
        record = Scan(1, tuple(map(str, range(count))), (0.5,) * count)
        assert codec.decode(Scan, codec.encode(record)) == record
    assert len(joint_state._READ) <= joint_state._MOST_READ


def test_more_names_than_a_stand_has_are_refused_with_their_number() -> None:
    names = tuple(f"channel_{number}" for number in range(MOST_NAMES + 1))
    data = codec.encode(Scan(1, names, (0.0,) * len(names)))
    with pytest.raises(WireError, match=f"{MOST_NAMES + 1} names, at most {MOST_NAMES}"):
        codec.decode(Scan, data)
    fewer = Scan(1, names[1:], (0.0,) * MOST_NAMES)
    assert codec.decode(Scan, codec.encode(fewer)) == fewer


@pytest.mark.parametrize("observed", [True, False])
def test_a_block_is_written_as_its_records_are(observed: bool) -> None:
    nan, estimate = math.nan, (("x",), (9.0,), (0.125,), (50.0, 1.0, 0.0))
    records = [
        Residual(stamp_ns, ("a", "b"), (1.0, nan), (nan, 0.25), (5.0, 6.0), ("u", "v"), (3.0, nan),
                 *(estimate if observed else ((), (), (), ())))
        for stamp_ns in (2_000_000_000, 2_010_000_007)
    ]  # fmt: skip
    assert list(codec.encode_block(block_of(*records))) == list(map(codec.encode, records))
