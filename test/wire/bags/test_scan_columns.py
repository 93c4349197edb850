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

"""Scans read as columns are those read one by one; what is not laid out alike is not guessed."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.bags.scan_columns import scan_block
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import Scan, Truth

CHANNELS = ("motor_current", "load_force", "ambient_temperature")
VALUES = st.tuples(*(st.floats(allow_nan=False),) * len(CHANNELS))
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
SCANS = st.lists(st.builds(Scan, STAMPS, st.just(CHANNELS), VALUES), min_size=1, max_size=20)


@settings(deadline=None)
@given(SCANS, st.integers(0, 16))
def test_columns_hold_what_single_messages_hold(scans, padding):
    messages = [encode(scan) + bytes(padding) for scan in scans]
    block = scan_block(messages)
    assert block is not None
    assert list(block.records()) == [decode(Scan, message) for message in messages] == scans


def messages(count: int = 4) -> list[bytes]:
    return [encode(Scan(k * 10**7, CHANNELS, (1.0, 2.0, float(k)))) for k in range(count)]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda data: data.replace(b"load_force", b"load_farce"),
        lambda data: data[:-1],
        lambda data: data[:8] + struct.pack("<I", 10**9) + data[12:],
        lambda data: b"\x00\x00" + data[2:],
        lambda data: data[:-8] + struct.pack("<II", 1, 0),
        lambda data: data[:4] + struct.pack("<i", -1) + data[8:],
    ],
    ids=["name", "length", "nanoseconds", "encapsulation", "velocity", "before 1970"],
)
def test_one_odd_message_makes_no_columns(spoil):
    odd = messages()
    odd[2] = spoil(odd[2])
    assert scan_block(odd) is None


def test_a_bag_read_in_blocks_is_the_bag_and_its_losses(tmp_path: Path):
    with BagWriter(tmp_path / "run", whole_every_s=None) as bag:
        for k in range(2500):
            bag.write(Scan(k * 10**7, CHANNELS, (1.0, 2.0, float(k))))
            if k == 100:
                bag.write(Truth(k * 10**7, "jam", 0))
            if k == 200:
                bag.write(Scan(k * 10**7 + 1, CHANNELS[:2], (1.0, 2.0)))
    one, many = BagReader(tmp_path / "run"), BagReader(tmp_path / "run")
    flat, blocks = [], 0
    for record in many.blocks():
        blocks += isinstance(record, ScanBlock)
        flat += record.records() if isinstance(record, ScanBlock) else [record]
    assert flat == [record for _, record in one.records()]
    assert one.losses == many.losses == []
    assert blocks >= 2
    assert len(flat) == 2502
    assert np.isfinite(flat[-1].values).all()
