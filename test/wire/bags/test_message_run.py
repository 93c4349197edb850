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

"""Messages that are alike are read together, and are those that are read one by one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from support import examples

from flea_diag.wire.bags import mcap_scan
from flea_diag.wire.bags.mcap_message import Channel
from flea_diag.wire.bags.mcap_piece import MESSAGE, MESSAGE_HEAD, RECORD
from flea_diag.wire.bags.mcap_scan import McapScan
from flea_diag.wire.bags.message_run import DATA, LEAST, MOST, run_of_alike

CHANNELS = {7: Channel("seven", "m", "cdr"), 263: Channel("other", "m", "cdr")}


def record(number: int, log_ns: int, data: bytes) -> bytes:
    head = MESSAGE_HEAD.pack(number, log_ns, log_ns, log_ns + 1)
    return RECORD.pack(MESSAGE, len(head) + len(data)) + head + data


def first_run(raw: bytes) -> list[Any]:
    return run_of_alike(raw, 0, RECORD.size + RECORD.unpack_from(raw)[1], CHANNELS)


kinds = st.tuples(st.sampled_from([7, 263, 9]), st.integers(0, 3))
runs = st.lists(st.tuples(kinds, st.integers(1, 2 * LEAST)), min_size=1, max_size=6)


@settings(max_examples=examples(200), deadline=None)
@given(runs)
def test_a_run_is_the_leading_messages_of_one_channel_and_size(parts: list[Any]) -> None:
    told = [kind for kind, count in parts for _ in range(count)]
    raw = b"".join(record(n, k, bytes([k % 256] * size)) for k, (n, size) in enumerate(told))
    leading = next((k for k, kind in enumerate(told) if kind != told[0]), len(told))
    found = first_run(raw)
    if leading < LEAST or told[0][0] not in CHANNELS:
        assert not found
        return
    assert [m.log_ns for m in found] == list(range(leading))
    assert [m.publish_ns for m in found] == list(range(1, leading + 1))
    assert {m.channel for m in found} == {CHANNELS[told[0][0]]}
    assert [m.data for m in found] == [bytes([k % 256] * told[0][1]) for k in range(leading)]


def test_a_run_is_bounded_and_a_head_too_short_is_none() -> None:
    many = b"".join(record(7, k, b"12") for k in range(2 * MOST))
    assert len(first_run(many)) == MOST
    short = (RECORD.pack(MESSAGE, 3) + b"\7\0\0") * LEAST
    assert len(short) < LEAST * DATA
    assert not first_run(short)


def test_a_file_has_the_same_messages_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "mixed.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=4096)
        writer.start(profile="ros2")
        schema = writer.register_schema("s", "ros2msg", b"")
        channels = [writer.register_channel(f"t{k}", "cdr", schema) for k in range(2)]
        for k in range(1500):
            other = k % 97 == 0 or 600 < k < 640
            log_ns = k - 30 if k % 200 == 0 else k  # chunks that overlap in time
            writer.add_message(channels[other], max(log_ns, 0), bytes(3 + (k > 900)), k, k)
        writer.finish()
    together = list(McapScan(path).messages())
    monkeypatch.setattr(mcap_scan, "run_of_alike", lambda *_: [])
    assert together == list(McapScan(path).messages())
    assert len(together) == 1500
