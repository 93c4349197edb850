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

"""SQLite bags that are a few kilobytes and unpack, or compute, gigabytes: refused in one line."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
import zstandard
from support import in_turn

from flea_diag.errors import RecordingError
from flea_diag.wire import records as r
from flea_diag.wire.bags.bag import BagReader, read_bag
from flea_diag.wire.messages.codec import encode

ROOT = Path(__file__).resolve().parents[3]
EPOCH_NS = 1_283_500_000 * 10**9
TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)"
SLOW = "INSERT INTO topics VALUES(1, '/sensors/slow', 'sensor_msgs/msg/JointState', 'cdr')"
ENDLESS = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT"


def described(bag: Path, file: str, mode: str = "") -> None:
    known = {
        "version": 9, "storage_identifier": "sqlite3", "relative_file_paths": [file],
        "compression_format": "zstd" if mode else "", "compression_mode": mode,
    }  # fmt: skip
    (bag / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": known}))


def database(bag: Path, *statements: str, rows: list[tuple[object, ...]] | None = None) -> Path:
    """The statements as a database in the bag's folder."""
    with sqlite3.connect(bag / "run_0.db3") as made:
        for statement in statements:
            made.execute(statement)
        for row in rows or ():
            made.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", row)
    made.close()
    return bag / "run_0.db3"


def zeros(packed_bytes: int = 4 << 30) -> bytes:
    """So many zeros, packed by zstd, with the true size or none in its head."""
    writer = zstandard.ZstdCompressor().compressobj()
    part = bytes(16 << 20)
    parts = [writer.compress(part) for _ in range(packed_bytes // len(part))]
    return b"".join(parts) + writer.flush()


def packed_file(bag: Path) -> None:
    (bag / "run_0.db3.zstd").write_bytes(zeros())
    described(bag, "run_0.db3.zstd", "FILE")


def packed_message(bag: Path) -> None:
    database(bag, TOPICS, MESSAGES, SLOW, rows=[(1, EPOCH_NS, zeros())])
    described(bag, "run_0.db3", "MESSAGE")


def many_packed_messages(bag: Path) -> None:
    one = zeros(48 << 20)
    rows = [(1, EPOCH_NS + k, one) for k in range(200)]
    database(bag, TOPICS, MESSAGES, SLOW, rows=rows)
    described(bag, "run_0.db3", "message")


def endless_view(bag: Path) -> None:
    view = f"CREATE VIEW messages AS {ENDLESS} k AS id, 1 AS topic_id, k AS timestamp,"
    database(bag, TOPICS, SLOW, f"{view} zeroblob(100000) AS data FROM n")
    described(bag, "run_0.db3")


def endless_topics(bag: Path) -> None:
    view = f"CREATE VIEW topics AS {ENDLESS} k AS id, 'a' AS name, 'b' AS type,"
    database(bag, MESSAGES, f"{view} 'cdr' AS serialization_format FROM n")
    described(bag, "run_0.db3")


def computed_column(bag: Path) -> None:
    data = "data BLOB AS (zeroblob(500000000))"
    table = f"CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, {data})"
    database(bag, TOPICS, SLOW, table, "INSERT INTO messages VALUES(1, 1, 5)")
    described(bag, "run_0.db3")


BOMBS: dict[str, tuple[Callable[[Path], None], str]] = {
    "packed file": (packed_file, "unpacks to more than 1000 MB"),
    "packed message": (packed_message, "a message unpacks to more than 67 MB"),
    "many packed messages": (many_packed_messages, "unpacks to more than 1000 MB"),
    "endless view": (endless_view, "is not an ordinary table"),
    "endless topics": (endless_topics, "is not an ordinary table"),
    "computed column": (computed_column, "is not an ordinary table"),
}

BOUNDED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (500 << 20, 500 << 20))
resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20))
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
from flea_diag.errors import RecordingError
from flea_diag.wire.bags.bag import read_bag
try:
    print(sum(1 for _ in read_bag(sys.argv[1])))
except RecordingError as error:
    sys.exit(f"flea: {error}")
"""
"""A reader with 500 MB of memory and files of 1 MB."""


@pytest.mark.parametrize("name", in_turn(list(BOMBS), 3))
def test_a_bomb_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    make, words = BOMBS[name]
    make(tmp_path)
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) < 1 << 20
    done = subprocess.run(
        [sys.executable, "-c", BOUNDED, str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("flea: cannot read bag"), done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("mode", ["", "file", "message", "NONE"])
def test_sound_bags_are_read_in_every_mode(mode: str, tmp_path: Path) -> None:
    scans = [r.Scan(EPOCH_NS + k, ("motor_current",), (float(k),)) for k in range(20)]
    pack = zstandard.ZstdCompressor().compress
    packed = [pack(encode(s)) if mode == "message" else encode(s) for s in scans]
    rows: list[tuple[object, ...]] = [
        (1, scan.stamp_ns, data) for scan, data in zip(scans, packed, strict=True)
    ]
    file = database(tmp_path, TOPICS, MESSAGES, SLOW, rows=rows[::-1])
    if mode == "file":
        (tmp_path / "run_0.db3.zstd").write_bytes(pack(file.read_bytes()))
        file.unlink()
    described(tmp_path, "run_0.db3.zstd" if mode == "file" else "run_0.db3", mode)
    assert [record for _, record in read_bag(tmp_path)] == scans


def test_rows_of_the_wrong_kind_are_counted(tmp_path: Path) -> None:
    good = r.Scan(EPOCH_NS, ("motor_current",), (1.0,))
    rows: list[tuple[object, ...]] = [
        (1, "soon", encode(good)), (1, EPOCH_NS, encode(good)), (7, EPOCH_NS, b""), (1, 5, "text"),
    ]  # fmt: skip
    database(tmp_path, TOPICS, MESSAGES, SLOW, rows=rows)
    described(tmp_path, "run_0.db3")
    reader = BagReader(tmp_path)
    assert [record for _, record in reader.records()] == [good]
    assert reader.losses == ["run_0.db3: 3 unreadable rows of messages"]


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"no database at all, " * 60, "not a database"), (b"", "it has no table 'topics'")],
)
def test_what_is_no_database_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "run_0.db3").write_bytes(content)
    described(tmp_path, "run_0.db3")
    with pytest.raises(RecordingError, match=words):
        BagReader(tmp_path)
