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

"""What the files of one command share, and what each has for itself."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.bombs.mcap import TIME_NS, chunk, end, header, message, slow_channel

from flea_diag.errors import RecordingError
from flea_diag.tools.workers import worker_pool
from flea_diag.wire.bags.budget import HELD_BYTES, SMALL_BYTES, Budget
from flea_diag.wire.bags.mcap_scan import McapScan
from flea_diag.wire.bags.sqlite_source import _rows
from flea_diag.wire.command_budget import (
    LIMITS,
    MEGABYTE,
    Quantity,
    begin_command,
    end_command,
)
from flea_diag.wire.regular_file import opened

MESSAGES = LIMITS[Quantity.MESSAGES].least


@pytest.fixture(autouse=True)
def command(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for limit in LIMITS:
        monkeypatch.delenv(limit.variable, raising=False)
    begin_command()
    yield
    end_command()


def test_many_files_share_what_each_could_unpack_to_alone() -> None:
    for number in range(4):
        Budget(f"bag_{number}", 1000).unpack(240 * MEGABYTE)
    with pytest.raises(RecordingError, match=r"bag_4: with the files read before .* FLEA_BAG"):
        Budget("bag_4", 1000).unpack(240 * MEGABYTE)


def test_many_files_share_their_messages() -> None:
    for number in range(3):
        Budget(f"bag_{number}", 10).count(MESSAGES // 3)
    words = r"bag_3: with the files read before it contains more than 300000 messages; .* raise "
    with pytest.raises(RecordingError, match=f"{words}.*FLEA_MESSAGE_LIMIT=3000000"):
        Budget("bag_3", 10).count(100)


def test_files_of_some_size_are_granted_more() -> None:
    for number in range(20):
        budget = Budget(f"bag_{number}", MEGABYTE)
        budget.unpack(900 * MEGABYTE)
        budget.count(MEGABYTE)


def test_a_new_command_begins_anew() -> None:
    Budget("a", 0).unpack(900 * MEGABYTE)
    begin_command()
    Budget("b", 0).unpack(900 * MEGABYTE)


def test_a_program_that_runs_for_ever_limits_each_file_alone() -> None:
    end_command()
    for number in range(5):
        Budget(f"bag_{number}", 0).unpack(900 * MEGABYTE)


def test_one_file_is_refused_for_itself() -> None:
    budget = Budget("a", 0)
    budget.unpack(1000 * MEGABYTE)
    with pytest.raises(RecordingError, match="a: it unpacks to more than 1000 MB"):
        budget.unpack(1)
    with pytest.raises(RecordingError, match="a: it contains more than 300000 messages"):
        budget.count(MESSAGES + 1)
    with pytest.raises(RecordingError, match="overlap in time"):
        budget.hold(HELD_BYTES)
    with pytest.raises(RecordingError, match="schemas, channels and attachments"):
        budget.keep(SMALL_BYTES + 1)


def test_the_variable_that_is_named_raises_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEA_MESSAGE_LIMIT", "3000000")
    Budget("a", 0).count(2_000_000)
    with pytest.raises(RecordingError, match="3000000 messages"):
        Budget("b", 0).count(1_000_001)


def test_the_sizes_of_files_are_summed_each_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLEA_READ_LIMIT_MB", "1")
    for name in "ab":
        (tmp_path / name).write_bytes(bytes(600_000))
    for _ in range(3):
        opened(tmp_path / "a").close()
    with pytest.raises(RecordingError, match=r"b: .* more than 1 MB; .* FLEA_READ_LIMIT_MB="):
        opened(tmp_path / "b")


def busy(milliseconds: int) -> None:
    """Take CPU time of this thread."""
    import time

    until_s = time.thread_time() + milliseconds / 1000
    while time.thread_time() < until_s:
        pass


def test_reading_time_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEA_READ_LIMIT_S", "0")
    budget = Budget("a", 0)
    busy(20)
    budget.resume()  # what others do is not charged
    busy(20)
    with pytest.raises(RecordingError, match="a: reading takes more than 0 s of CPU time"):
        budget.spend()


def bag_in_order(path: Path) -> Path:
    """Chunks that do not overlap, of more messages than a file of this size may hold."""
    parts = []
    for now_ns in range(TIME_NS, TIME_NS + 10):
        one = slow_channel() + message(0, now_ns) * (MESSAGES // 8)
        parts.append(chunk(one, now_ns, now_ns))
    path.write_bytes(header() + b"".join(parts) + end())
    return path


def read_all(path: str) -> int:
    """Number of messages of a file; what a worker process does."""
    return sum(1 for _ in McapScan(Path(path)).messages())


def test_empty_messages_in_order_are_refused_by_their_number(tmp_path: Path) -> None:
    path = bag_in_order(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match=r"a\.mcap: it contains more than 300000 messages"):
        read_all(str(path))


def test_worker_processes_share_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEA_MESSAGE_LIMIT", "1500")
    content = header() + chunk(slow_channel() + message(0) * 1000) + end()
    paths = [tmp_path / f"{name}.mcap" for name in "ab"]
    for path in paths:
        path.write_bytes(content)
    assert len(content) < 700
    errors = []
    for path in paths:  # One after the other: at once, each may meet what the other has spent.
        with worker_pool(1) as pool:
            errors.append(pool.submit(read_all, str(path)).exception())
    assert [type(error) for error in errors] == [type(None), RecordingError]


def test_a_pass_over_a_file_has_a_budget_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    end_command()
    monkeypatch.setenv("FLEA_MESSAGE_LIMIT", "1500")
    path = tmp_path / "a.mcap"
    path.write_bytes(header() + chunk(slow_channel() + message(0) * 1000) + end())
    scan = McapScan(path)
    assert [sum(1 for _ in scan.messages()) for _ in range(5)] == [1000] * 5


def test_a_channel_is_found_behind_a_message_of_it(tmp_path: Path) -> None:
    """Where no summary names the channels, definitions are looked for first, and alone."""
    path = tmp_path / "a.mcap"
    path.write_bytes(header() + chunk(message(0) + slow_channel() + message(0)))
    assert read_all(str(path)) == 2


ENDLESS = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT count(k) FROM n"


def test_a_query_without_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLEA_READ_LIMIT_S", "1")
    with pytest.raises(RecordingError, match="reading takes more than 1 s"):
        list(_rows(sqlite3.connect(":memory:"), ENDLESS, Budget("a.db3", 0)))
