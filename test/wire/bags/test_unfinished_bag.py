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

"""Bags whose writer was killed: what SQLite keeps beside a database is read, losses are said."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.messages.codec import encode
from flea_diag.wire.records import Scan

EPOCH_NS = 1_700_000_000_000_000_000
TABLES = (
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)",
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)",
    "INSERT INTO topics VALUES(1, '/sensors/slow', 'sensor_msgs/msg/JointState', 'cdr')",
)


def scans(count: int) -> list[Scan]:
    return [Scan(EPOCH_NS + k, ("motor_current",), (float(k),)) for k in range(count)]


def killed(folder: Path, mode: str) -> Path:
    """A database as it is on disk in the middle of its recording."""
    live, found = folder / "live", folder / "bag"
    live.mkdir()
    with sqlite3.connect(live / "run_0.db3", isolation_level=None) as made:
        made.execute(f"PRAGMA journal_mode={mode}")
        made.execute("PRAGMA cache_size=1")
        for statement in TABLES:
            made.execute(statement)
        rows = [(1, scan.stamp_ns, encode(scan)) for scan in scans(200)]
        insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)"
        for row in rows[:100]:
            made.execute(insert, row)
        made.execute("BEGIN")
        made.executemany(insert, rows[100:])
        if mode == "WAL":
            made.execute("COMMIT")
        shutil.copytree(live, found)
    made.close()
    return found


@pytest.mark.parametrize(("mode", "count"), [("WAL", 200), ("DELETE", 100)])
def test_what_lies_beside_a_database_is_read_and_left_alone(
    tmp_path: Path, mode: str, count: int
) -> None:
    """Of a journal, what had been committed; of a log, all of it."""
    bag = killed(tmp_path, mode)
    beside = sorted(path.name for path in bag.iterdir())
    assert len(beside) > 1
    contents = {name: (bag / name).read_bytes() for name in beside}
    assert [record for _, record in BagReader(bag / "run_0.db3").records()] == scans(count)
    assert {path.name: path.read_bytes() for path in bag.iterdir()} == contents


def test_messages_that_are_counted_and_not_there_are_said(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    with BagWriter(bag) as made:
        for scan in scans(10):
            made.write(scan)
    sound = BagReader(bag)
    assert len(list(sound.records())) == 10
    assert sound.losses == []
    known = yaml.safe_load((bag / "metadata.yaml").read_text())
    rows = known["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert rows[0]["message_count"] == 10
    rows[0]["message_count"] = 12
    (bag / "metadata.yaml").write_text(yaml.safe_dump(known))
    reader = BagReader(bag)
    list(reader.records())
    assert reader.losses == [
        "/sensors/slow: 2 of the 12 messages that metadata.yaml counts are not in the bag"
    ]


def removed(path: Path) -> None:
    path.unlink()


def replaced(path: Path) -> None:
    path.unlink()
    path.write_bytes(b"mine")


def truncated(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(100)


@pytest.mark.parametrize("take", [removed, replaced, truncated])
@pytest.mark.parametrize("at_the_end", [False, True])
def test_a_file_that_is_taken_away_is_said_and_another_one_is_begun(
    tmp_path: Path, take: Callable[[Path], None], at_the_end: bool
) -> None:
    bag = tmp_path / "bag"
    with BagWriter(bag, whole_every_s=None) as made:
        made.attach("note", "kept")
        for scan in scans(10):
            made.write(scan)
        made.make_whole()
        take(made.path)
        if not at_the_end:
            made.make_whole()
            for scan in scans(13)[10:]:
                made.write(scan)
    assert made.losses == [
        f"{bag / 'bag_0.mcap'} was {take.__name__} while it was recorded: 10 messages are lost"
    ]
    if at_the_end:  # nothing is left but the file that was begun
        assert (bag / "bag_1.mcap").exists()
        return
    reader = BagReader(bag)
    assert [record for _, record in reader.records()] == scans(13)[10:]
    assert reader.losses == []
    assert reader.attachments["note"] == "kept"
