"""Alarms, acknowledgements, comments and marks in an SQLite file that survives a restart.

Several screens may share one file (SQLite's write-ahead log); an acknowledgement on one of them
appears on the others at their next read.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from flea_diag.errors import ConfigurationError, RecordingError, shown
from flea_diag.formats import FORMATS, KEY, migrated
from flea_diag.nodes.operator.alarm_row import (
    LONGEST_RECORD,
    action_of,
    alarm_of,
    comment_of,
    text_of,
)
from flea_diag.nodes.set_aside import set_aside
from flea_diag.nodes.state_folder import state_folder
from flea_diag.operator.alarm import REPLAY, Alarm, AlarmAction, Comment, Key
from flea_diag.operator.state import MOST_TIMES
from flea_diag.wire.records import NEVER_NS, Remark, RemarkKind

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
ALARM = (
    "SELECT source, detected_ns, CASE WHEN length(record) <= ? THEN record END, acknowledged_ns, "
    "acknowledged_by FROM alarm WHERE stand = ?"
)
WAITS = f"(acknowledged_ns = -1 AND source != '{REPLAY}')"
SERVICE: Key = ("service", NEVER_NS)
"""Source and detection stamp of what is done to all alarms of a stand."""
ACTIONS = (RemarkKind.WITHDRAWN, RemarkKind.SHELVED, RemarkKind.UNSHELVED)
MARK: Key = ("mark", NEVER_NS)
"""Source and detection stamp of a mark: a comment on a moment, without an alarm."""
BUSY_S = 2.0
LONGEST_TEXT = 2000
LONGEST_NAME = 100
MOST_COMMENTS = 1000
COMPANIONS = ("-wal", "-shm")
"""Files that SQLite keeps beside a database."""

T = TypeVar("T")


def default_path() -> Path:
    """Default path of the journal."""
    return state_folder() / "alarms.sqlite"


class AlarmJournal:
    """The alarms of one stand.

    A damaged file is set aside, and a fresh one takes its place; a row that cannot be read is left
    out. Both are said once.

    Parameters
    ----------
    path
        SQLite file; its folder is created if missing.
    stand
        Name of the stand; a file may hold several.
    say
        Takes what the operator must know, one line each.

    Raises
    ------
    ConfigurationError
        The file cannot be opened, is no regular file, or is a newer journal.
    """

    def __init__(
        self, path: Path, stand: str = "stand", say: Callable[[str], None] = lambda _: None
    ) -> None:
        self.path, self._stand, self._say = path, stand, say
        self._broken: set[Any] = set()
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

    def _rows(self, statement: str, values: Sequence[Any] = ()) -> list[Any]:
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

    def note(self, alarm: Alarm) -> None:
        """Store the recorded content of an alarm; acknowledgement and comments are kept."""
        self._rows(
            "INSERT INTO alarm (stand, source, detected_ns, record) VALUES (?, ?, ?, ?) "
            "ON CONFLICT DO UPDATE SET record = excluded.record "
            "WHERE record != excluded.record",
            (self._stand, *alarm.key, text_of(alarm)),
        )

    def keep(self, remark: Remark) -> None:
        """Store a remark once, even if it arrives several times."""
        key = remark.source, remark.detected_ns
        if remark.kind is RemarkKind.ACKNOWLEDGED:
            self._acknowledge(key, remark.stamp_ns, remark.author)
            return
        if remark.kind in ACTIONS or remark.kind.is_on_service:
            self._act(SERVICE if remark.kind.is_on_service else key, remark)
            return
        on_unit, text = remark.kind.is_on_unit, remark.text
        if on_unit:
            text = ": ".join(filter(None, (remark.kind.value, text)))
        alone = on_unit or remark.kind is RemarkKind.MARK
        self._comment(MARK if alone else key, Comment(remark.stamp_ns, remark.author, text))

    def _acknowledge(self, key: Key, stamp_ns: int, author: str) -> None:
        """Acknowledge an alarm, unless it is unknown or already acknowledged."""
        self._rows(
            "UPDATE alarm SET acknowledged_ns = ?, acknowledged_by = ? WHERE stand = ? "
            "AND source = ? AND detected_ns = ? AND acknowledged_ns = -1 AND NOT EXISTS (SELECT 1 "
            "FROM action WHERE stand = ? AND source = ? AND detected_ns = ? AND kind = ? "
            "AND stamp_ns >= ?)",
            (
                stamp_ns, author[:LONGEST_NAME], self._stand, *key, self._stand, *key,
                RemarkKind.WITHDRAWN.value, stamp_ns,
            ),
        )  # fmt: skip

    def _act(self, key: Key, remark: Remark) -> None:
        """Store what was done; an acknowledgement that is withdrawn is none."""
        if remark.kind is RemarkKind.WITHDRAWN:
            self._rows(
                "UPDATE alarm SET acknowledged_ns = -1, acknowledged_by = '' WHERE stand = ? "
                "AND source = ? AND detected_ns = ? AND acknowledged_ns <= ?",
                (self._stand, *key, remark.stamp_ns),
            )
        said = remark.author[:LONGEST_NAME], remark.text.strip()[:LONGEST_TEXT], remark.until_ns
        self._rows(
            "INSERT INTO action VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
            (self._stand, *key, remark.stamp_ns, remark.kind.value, *said),
        )

    def service(self) -> AlarmAction | None:
        """What was last done to all alarms of the stand."""
        return next(reversed(self._actions(SERVICE)), None)

    def _actions(self, key: Key) -> tuple[AlarmAction, ...]:
        rows = self._rows(
            "SELECT stamp_ns, kind, author, text, until_ns FROM action WHERE stand = ? "
            "AND source = ? AND detected_ns = ? ORDER BY stamp_ns DESC, rowid DESC LIMIT ?",
            (self._stand, *key, MOST_COMMENTS),
        )
        return tuple(
            action
            for row in reversed(rows)
            for action in self._read((*key, row[0]), action_of, *row)
        )

    def _comment(self, key: Key, comment: Comment) -> None:
        """Add a comment to an alarm, unless it is stored already."""
        text = comment.text.strip()[:LONGEST_TEXT]
        if not text:
            return
        row = (self._stand, *key, comment.stamp_ns, comment.author[:LONGEST_NAME], text)
        self._rows(
            "INSERT INTO comment SELECT ?, ?, ?, ?, ?, ? WHERE NOT EXISTS (SELECT 1 "
            "FROM comment WHERE stand = ? AND source = ? AND detected_ns = ? "
            "AND stamp_ns = ? AND author = ? AND text = ?)",
            (*row, *row),
        )

    def alarms(self, most: int = 100, also: Sequence[int] = ()) -> tuple[Alarm, ...]:
        """Alarms with their acknowledgements and comments, oldest first.

        Those that nobody has acknowledged come before the others: the first of them and the latest.
        ``also`` are stamps of detections that are to be among them.
        """
        asked = (LONGEST_RECORD, self._stand)
        rows = self._rows(
            f"SELECT * FROM ({ALARM} ORDER BY {WAITS} DESC, detected_ns DESC LIMIT ?) UNION "
            f"SELECT * FROM ({ALARM} AND {WAITS} ORDER BY detected_ns LIMIT 1) UNION "
            f"{ALARM} AND detected_ns IN ({', '.join('?' * len(also))}) ORDER BY 2",
            (*asked, most, *asked, *asked, *also),
        )
        read = [alarm for row in rows for alarm in self._read(row[:2], alarm_of, *row)]
        return tuple(
            replace(alarm, comments=self._comments(alarm.key), actions=self._actions(alarm.key))
            for alarm in read
        )

    def times(self, most: int = MOST_TIMES) -> tuple[int, ...]:
        """Stamps of the latest alarms."""
        rows = self._rows(
            "SELECT detected_ns FROM alarm WHERE stand = ? ORDER BY detected_ns DESC LIMIT ?",
            (self._stand, most),
        )
        return tuple(row[0] for row in rows)

    def waiting(self) -> int:
        """Number of alarms that nobody has acknowledged."""
        rows = self._rows(f"SELECT count(*) FROM alarm WHERE stand = ? AND {WAITS}", (self._stand,))
        return int(rows[0][0])

    def marks(self, most: int = 100) -> tuple[Comment, ...]:
        """The latest marks, oldest first."""
        return self._comments(MARK)[-most:]

    def version(self) -> int:
        """Version number that changes when another process has written to the file."""
        return int(self._rows("PRAGMA data_version")[0][0])

    def _comments(self, key: Key) -> tuple[Comment, ...]:
        rows = self._rows(
            "SELECT stamp_ns, author, substr(text, 1, ?) FROM comment WHERE stand = ? "
            "AND source = ? AND detected_ns = ? ORDER BY stamp_ns DESC, rowid DESC LIMIT ?",
            (LONGEST_TEXT, self._stand, *key, MOST_COMMENTS),
        )
        return tuple(
            comment
            for row in reversed(rows)
            for comment in self._read((*key, row[0]), comment_of, *row)
        )

    def _read(self, key: Any, make: Callable[..., T], *values: Any) -> Iterator[T]:
        """What a row says; nothing of a broken one, which is said once."""
        try:
            yield make(*values)
        except ValueError as error:
            if key not in self._broken:
                self._broken.add(key)
                if len(self._broken) == 1:
                    self._say(
                        f"journal {self.path}: a row cannot be read ({shown(key)}: "
                        f"{error}), it and others like it are left out"
                    )


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
