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

"""Reads a bag in SQLite storage: rosbag2's tables ``topics`` and ``messages``.

A database is a program as much as a file: a view, a generated column or a virtual table of a few
bytes yields rows without end. Only ordinary tables are read, and what is compressed is measured
before it is unpacked.
"""

from __future__ import annotations

import shutil
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from flea_diag.errors import RecordingError, shown
from flea_diag.wire.bags.bag_description import BagDescription
from flea_diag.wire.bags.budget import STORAGE_RATIO, Budget
from flea_diag.wire.bags.mcap_chunk import CHUNK_LIMIT_BYTES, DamageError, unzstd
from flea_diag.wire.bags.mcap_message import Channel, McapMessage
from flea_diag.wire.command_budget import MEGABYTE
from flea_diag.wire.regular_file import opened

TABLES = ("topics", "messages")
MOST_TOPICS = 10_000
LONGEST_NAME = 1000
PART_BYTES = 1 << 20
UNFINISHED = ("-wal", "-journal")
"""Endings of SQLite's write-ahead log and of its rollback journal."""
STEPS = 100_000
"""Instructions of SQLite's machine, some milliseconds, after which its time is looked at."""


class SqliteSource:
    """The files of one bag, one after the other.

    Raises
    ------
    RecordingError
        A file is missing, is no such database, or unpacks to more than its budget.
    """

    def __init__(self, directory: Path, known: BagDescription) -> None:
        self.attachments: dict[str, bytes] = {}
        self.losses: list[str] = []
        self._packed = known.compression
        self._files = [directory / Path(name).name for name in known.files]
        if self._packed not in ("", "file", "message"):
            raise RecordingError(f"{directory}: compression mode {shown(self._packed)} is unknown")
        self.channels: dict[tuple[Path, int], Channel] = {}
        for file in self._files:
            with self._database(file) as database:
                self.channels |= {(file, key): c for key, c in _topics(database).items()}

    def messages(self) -> Iterator[McapMessage]:
        """All messages, in order of log time within each file."""
        for file in self._files:
            with self._database(file) as database:
                yield from self._messages(file, database)

    def together(self) -> Iterator[list[McapMessage]]:
        """The same, each by itself."""
        return ([message] for message in self.messages())

    def _messages(self, file: Path, database: sqlite3.Connection) -> Iterator[McapMessage]:
        budget = Budget(file.name, file.stat().st_size, STORAGE_RATIO)
        query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, rowid"
        bad = 0
        for topic, log_ns, data in _rows(database, query, budget):
            channel = self.channels.get((file, topic))
            if channel is None or type(log_ns) is not int or not isinstance(data, bytes):
                bad += 1
                continue
            try:
                whole = self._unpacked_message(data, budget)
            except DamageError:
                bad += 1
            else:
                yield McapMessage(log_ns, log_ns, channel, whole)
        if bad:
            self.losses.append(f"{file.name}: {bad} unreadable rows of messages")

    def _unpacked_message(self, data: bytes, budget: Budget) -> bytes:
        if self._packed != "message":
            return data
        whole = unzstd(data, CHUNK_LIMIT_BYTES + 1)
        if len(whole) > CHUNK_LIMIT_BYTES:
            raise RecordingError(
                f"a message unpacks to more than {CHUNK_LIMIT_BYTES / MEGABYTE:.0f} MB"
            )
        budget.unpack(len(whole))
        return whole

    @contextmanager
    def _database(self, file: Path) -> Iterator[sqlite3.Connection]:
        """One file, opened for reading; a compressed one is unpacked into a temporary folder."""
        try:
            with TemporaryDirectory(prefix="flea_bag_") as folder:
                plain = file
                if self._packed == "file":
                    plain = Path(folder) / "bag.db3"
                    _unpack(file, plain)
                with opened(plain):  # a regular file, not waited for
                    pass
                place = f"{plain.resolve().as_uri()}?mode=ro&immutable=1"
                if self._packed != "file" and any(_unfinished(plain)):
                    # SQLite finishes what its writer did not, in a copy: nothing is written here.
                    place = f"{_copied(plain, Path(folder)).as_uri()}?mode=rw"
                with closing(sqlite3.connect(place, uri=True)) as database:
                    if sys.version_info >= (3, 11):
                        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, CHUNK_LIMIT_BYTES)
                    _check_tables(database)
                    yield database
        except (RecordingError, DamageError, sqlite3.Error, OSError) as error:
            reason = getattr(error, "strerror", None) or error
            raise RecordingError(f"cannot read bag {file}: {reason}") from error


def _unfinished(file: Path) -> Iterator[Path]:
    """What a writer that was killed has left beside a database: its log, or its journal."""
    for ending in UNFINISHED:
        beside = file.with_name(file.name + ending)
        if beside.is_file() and beside.stat().st_size:
            yield beside


def _copied(file: Path, folder: Path) -> Path:
    """Copy a database with what is beside it; only where the disk has room for it.

    Raises
    ------
    RecordingError
        It does not.
    """
    parts = (file, *_unfinished(file))
    size, free = sum(part.stat().st_size for part in parts), shutil.disk_usage(folder).free
    if 2 * size > free:
        raise RecordingError(
            f"its recorder was killed, messages are in {parts[1].name}, and its copy of "
            f"{size / MEGABYTE:.0f} MB needs twice that in {folder.parent} (TMPDIR), where "
            f"{free / MEGABYTE:.0f} MB are left: finish it with sqlite3 {file.name} .tables"
        )
    for part in parts:
        with opened(part) as source, (folder / part.name).open("wb") as copy:
            shutil.copyfileobj(source, copy)
    return (folder / file.name).resolve()


def _unpack(packed: Path, plain: Path) -> None:
    """Unpack a file of zstd; its size is counted first, so that a bomb fills no disk."""
    budget = Budget(packed.name, packed.stat().st_size, STORAGE_RATIO)
    for part in _parts(packed):
        budget.unpack(len(part))
    with plain.open("wb") as file:
        for part in _parts(packed):
            file.write(part)


def _parts(packed: Path) -> Iterator[bytes]:
    try:
        import zstandard
    except ImportError as error:
        raise RecordingError(f"it needs the package mcap: pip install mcap ({error})") from error
    with opened(packed) as file:
        reader = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
        try:
            while part := reader.read(PART_BYTES):
                yield part
        except zstandard.ZstdError as error:
            raise DamageError(f"cannot be decompressed: {error}") from None


def _check_tables(database: sqlite3.Connection) -> None:
    """Refuse tables that compute what they hold."""
    query = "SELECT type, sql FROM sqlite_master WHERE lower(name) = ?"
    for table in TABLES:
        found = database.execute(query, (table,)).fetchone()
        if found is None:
            raise RecordingError(f"it has no table {shown(table)}")
        plain = found[0] == "table" and not str(found[1]).upper().startswith("CREATE VIRTUAL")
        # ``hidden`` is 2 or 3 for a generated column.
        columns = database.execute(f"PRAGMA table_xinfo({table})") if plain else ()
        if not plain or any(hidden for *_, hidden in columns):
            raise RecordingError(f"{shown(table)} is not an ordinary table: its rows are computed")


def _rows(database: sqlite3.Connection, query: str, budget: Budget) -> Iterator[tuple[Any, ...]]:
    """Rows of a query, charged to the budget; the time before the first one, too."""
    refused: list[RecordingError] = []

    def over() -> bool:
        try:
            budget.spend()
        except RecordingError as error:
            refused.append(error)
        return bool(refused)

    budget.resume()
    database.set_progress_handler(over, STEPS)
    try:
        rows = database.execute(query)
        while (row := rows.fetchone()) is not None:
            budget.count(1)
            budget.spend()
            yield row
            budget.resume()
    except sqlite3.OperationalError:
        if refused:
            raise refused[0] from None
        raise
    finally:
        database.set_progress_handler(None, 0)


def _topics(database: sqlite3.Connection) -> dict[int, Channel]:
    query = "SELECT id, name, type, serialization_format FROM topics LIMIT ?"
    rows = database.execute(query, (MOST_TOPICS + 1,)).fetchmany(MOST_TOPICS + 1)
    texts = [text for row in rows for text in row[1:]]
    if len(rows) > MOST_TOPICS or any(
        not isinstance(text, str) or len(text) > LONGEST_NAME for text in texts
    ):
        raise RecordingError(
            f"'topics' must be at most {MOST_TOPICS} rows of texts up to {LONGEST_NAME} characters"
        )
    return {key: Channel(topic, message, form) for key, topic, message, form in rows}
