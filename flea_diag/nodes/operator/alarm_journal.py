"""Alarms, acknowledgements, comments and marks in an SQLite file that survives a restart.

Several screens may share one file (SQLite's write-ahead log); an acknowledgement on one of them
appears on the others at their next read.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from pathlib import Path

from flea_diag.errors import ConfigurationError, RecordingError
from flea_diag.formats import FORMATS, KEY, migrated
from flea_diag.nodes.state_folder import state_folder
from flea_diag.operator.alarm import Alarm, Comment, Key, Member
from flea_diag.wire.records import NEVER_NS, Outcome, Remark, RemarkKind, Symbol

SCHEMA = """
CREATE TABLE IF NOT EXISTS alarm (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    record TEXT NOT NULL, acknowledged_ns INTEGER NOT NULL DEFAULT -1,
    acknowledged_by TEXT NOT NULL DEFAULT '', PRIMARY KEY (stand, source, detected_ns));
CREATE TABLE IF NOT EXISTS comment (
    stand TEXT NOT NULL, source TEXT NOT NULL, detected_ns INTEGER NOT NULL,
    stamp_ns INTEGER NOT NULL, author TEXT NOT NULL, text TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS comment_alarm ON comment (stand, source, detected_ns);
"""
MARK: Key = ("mark", NEVER_NS)
"""Source and detection stamp of a mark: a comment on a moment, without an alarm."""
BUSY_S = 2.0
LONGEST_TEXT = 2000
LONGEST_NAME = 100


def default_path() -> Path:
    """Default path of the journal."""
    return state_folder() / "alarms.sqlite"


class AlarmJournal:
    """The alarms of one stand.

    Raises
    ------
    ConfigurationError
        The file cannot be opened, is not a journal, or is a newer one.
    """

    def __init__(self, path: Path, stand: str = "stand") -> None:
        self.path, self._stand = path, stand
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # A screen may draw in one thread and receive records in another; SQLite serialises.
            self._db = sqlite3.connect(
                path, timeout=BUSY_S, isolation_level=None, check_same_thread=False
            )
            self._db.execute("PRAGMA journal_mode = WAL")
            self._make_tables()
        except (OSError, sqlite3.Error) as error:
            raise ConfigurationError(
                f"journal = {str(path)!r} cannot be used ({error}): name a writable file"
            ) from None

    def _make_tables(self) -> None:
        """Make what is missing; SQLite's ``user_version`` (0: never set) is the format's."""
        (found,) = self._db.execute("PRAGMA user_version").fetchone()
        migrated("alarm journal", {KEY: found}, f"journal {self.path}")
        self._db.executescript(SCHEMA)
        version = FORMATS["alarm journal"].version
        if found != version:
            self._db.execute(f"PRAGMA user_version = {version}")

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def note(self, alarm: Alarm) -> None:
        """Store the recorded content of an alarm; acknowledgement and comments are kept."""
        with self._told():
            self._db.execute(
                "INSERT INTO alarm (stand, source, detected_ns, record) VALUES (?, ?, ?, ?) "
                "ON CONFLICT DO UPDATE SET record = excluded.record "
                "WHERE record != excluded.record",
                (self._stand, *alarm.key, _text(alarm)),
            )

    def keep(self, remark: Remark) -> None:
        """Store a remark once, even if it arrives several times."""
        key = remark.source, remark.detected_ns
        if remark.kind is RemarkKind.ACKNOWLEDGED:
            self._acknowledge(key, remark.stamp_ns, remark.author)
            return
        said = Comment(remark.stamp_ns, remark.author, remark.text)
        self._comment(MARK if remark.kind is RemarkKind.MARK else key, said)

    def _acknowledge(self, key: Key, stamp_ns: int, author: str) -> None:
        """Acknowledge an alarm, unless it is unknown or already acknowledged."""
        with self._told():
            self._db.execute(
                "UPDATE alarm SET acknowledged_ns = ?, acknowledged_by = ? WHERE stand = ? "
                "AND source = ? AND detected_ns = ? AND acknowledged_ns = -1",
                (stamp_ns, author[:LONGEST_NAME], self._stand, *key),
            )

    def _comment(self, key: Key, comment: Comment) -> None:
        """Add a comment to an alarm, unless it is stored already."""
        text = comment.text.strip()[:LONGEST_TEXT]
        if not text:
            return
        row = (self._stand, *key, comment.stamp_ns, comment.author[:LONGEST_NAME], text)
        with self._told():
            self._db.execute(
                "INSERT INTO comment SELECT ?1, ?2, ?3, ?4, ?5, ?6 WHERE NOT EXISTS (SELECT 1 "
                "FROM comment WHERE stand = ?1 AND source = ?2 AND detected_ns = ?3 "
                "AND stamp_ns = ?4 AND author = ?5 AND text = ?6)",
                row,
            )

    def alarms(self, most: int = 100) -> tuple[Alarm, ...]:
        """The latest alarms with their acknowledgements and comments, oldest first."""
        with self._told():
            rows = self._db.execute(
                "SELECT source, detected_ns, record, acknowledged_ns, acknowledged_by FROM alarm "
                "WHERE stand = ? ORDER BY detected_ns DESC LIMIT ?",
                (self._stand, most),
            ).fetchall()
        return tuple(
            replace(
                _alarm(text),
                acknowledged_ns=acknowledged_ns,
                acknowledged_by=author,
                comments=self._comments((source, detected_ns)),
            )
            for source, detected_ns, text, acknowledged_ns, author in reversed(rows)
        )

    def marks(self, most: int = 100) -> tuple[Comment, ...]:
        """The latest marks, oldest first."""
        return self._comments(MARK)[-most:]

    def version(self) -> int:
        """Version number that changes when another process has written to the file."""
        return int(self._db.execute("PRAGMA data_version").fetchone()[0])

    def _comments(self, key: Key) -> tuple[Comment, ...]:
        rows = self._db.execute(
            "SELECT stamp_ns, author, text FROM comment WHERE stand = ? AND source = ? "
            "AND detected_ns = ? ORDER BY stamp_ns",
            (self._stand, *key),
        )
        return tuple(Comment(*row) for row in rows)

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise RecordingError(f"journal {self.path}: {error}") from None


LEFT_OUT = ("acknowledged_ns", "acknowledged_by", "comments")
"""Fields of an alarm that are stored in columns of their own."""


def _text(alarm: Alarm) -> str:
    content = asdict(alarm)
    for name in LEFT_OUT:
        del content[name]
    return json.dumps(content)


def _alarm(text: str) -> Alarm:
    content = json.loads(text)
    content["outcome"] = Outcome(content["outcome"])
    content["members"] = tuple(Member(**member) for member in content["members"])
    content["deviations"] = tuple(Symbol(**symbol) for symbol in content["deviations"])
    known = {entry.name for entry in fields(Alarm)}
    return Alarm(**{name: value for name, value in content.items() if name in known})
