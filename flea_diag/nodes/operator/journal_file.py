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

"""The SQLite file behind the journal of alarms: one that is damaged is set aside, work goes on."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.formats import FORMATS, KEY, migrated
from flea_diag.nodes.set_aside import set_aside

SCHEMA = """
CREATE TABLE IF NOT EXISTS alarm (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    record TEXT NOT NULL, acknowledged_ns INTEGER NOT NULL DEFAULT -1,
    acknowledged_by TEXT NOT NULL DEFAULT '', PRIMARY KEY (stand, source, detected_ns));
CREATE TABLE IF NOT EXISTS comment (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    stamp_ns INTEGER NOT NULL, author TEXT NOT NULL, text TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS action (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    stamp_ns INTEGER NOT NULL, kind TEXT NOT NULL, author TEXT NOT NULL, text TEXT NOT NULL,
    until_ns INTEGER NOT NULL,
    PRIMARY KEY (stand, source, detected_ns, stamp_ns, kind, author));
CREATE INDEX IF NOT EXISTS comment_alarm ON comment (stand, source, detected_ns);
"""
BUSY_S = 2.0
COMPANIONS = ("-wal", "-shm")
"""Files that SQLite keeps beside a database."""


class JournalFile:
    """Statements on one file, which several processes may have open.

    Parameters
    ----------
    path
        SQLite file; its folder is created if missing.
    say
        Takes what the operator must know, one line each.

    Raises
    ------
    ConfigurationError
        The file cannot be opened, is no regular file, or is a newer journal.
    """

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self.path, self._say = path, say
        self.openings = 0
        """Times that a file was opened: above one, alarms known before are missing in it."""
        if path.exists() and not path.is_file():
            raise ConfigurationError(f"journal = {str(path)!r} is no regular file: name another")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._connect()
        except (OSError, sqlite3.Error) as error:
            raise ConfigurationError(
                f"journal = {str(path)!r} cannot be used ({error}): name a writable file"
            ) from None

    def _connect(self) -> None:
        """Open the file, or a fresh one in its place where it is damaged."""
        try:
            self._open()
        except sqlite3.DatabaseError as error:
            if not _damaged(error):
                raise
            self._replace(error)

    def _open(self) -> None:
        # A screen may draw in one thread and receive records in another; SQLite serialises.
        self._db = sqlite3.connect(
            self.path, timeout=BUSY_S, isolation_level=None, check_same_thread=False
        )
        # One text that is not UTF-8 would make all rows unreadable.
        self._db.text_factory = lambda data: data.decode("utf-8", "replace")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._make_tables()
        self._file = _identity(self.path)
        self.openings += 1

    def _replace(self, error: sqlite3.Error) -> None:
        """Set the damaged file aside, unless another screen has done it, and open a fresh one."""
        opened = getattr(self, "_file", None)
        with suppress(sqlite3.Error):
            self._db.close()
        if opened is None or opened == _identity(self.path):
            kept = set_aside(self.path, COMPANIONS)
            self._say(
                f"journal {self.path} is damaged ({error}): it is kept as {kept.name}, alarms and "
                "comments go into a fresh one"
            )
        self._open()

    def _make_tables(self) -> None:
        """Make what is missing; SQLite's ``user_version`` (0: never set) is the format's."""
        (found,) = self._db.execute("PRAGMA user_version").fetchone()
        migrated("alarm journal", {KEY: found}, f"journal {self.path}")
        self._db.executescript(SCHEMA)
        version = FORMATS["alarm journal"].version
        if found != version:
            self._db.execute(f"PRAGMA user_version = {version}")

    def rows(self, statement: str, values: Sequence[Any] = ()) -> list[Any]:
        """Rows of a statement; on a damaged file it is made again on a fresh one.

        Raises
        ------
        RecordingError
            The file is locked, full, or cannot be replaced.
        """
        try:
            try:
                return self._db.execute(statement, values).fetchall()
            except sqlite3.DatabaseError as error:
                if not _damaged(error):
                    raise
                self._replace(error)
                return self._db.execute(statement, values).fetchall()
        except (OSError, OverflowError, UnicodeError, sqlite3.Error) as error:
            raise RecordingError(f"journal {self.path}: {error}") from None

    def close(self) -> None:
        """Close the file."""
        self._db.close()


def _damaged(error: sqlite3.Error) -> bool:
    """Whether the file is no database or a broken one: not just locked, full or read-only."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def _identity(path: Path) -> tuple[int, int]:
    """Which file stands under this name, (0, 0) for none."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return 0, 0
    return found.st_dev, found.st_ino
