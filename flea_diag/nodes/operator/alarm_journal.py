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

"""Alarms, acknowledgements, comments and marks in an SQLite file that survives a restart.

Several screens may share one file (SQLite's write-ahead log); an acknowledgement on one of them
appears on the others at their next read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from flea_diag.errors import shown
from flea_diag.nodes.operator.alarm_row import (
    LONGEST_RECORD,
    action_of,
    alarm_of,
    comment_of,
    text_of,
)
from flea_diag.nodes.operator.journal_file import JournalFile
from flea_diag.nodes.state_folder import state_folder
from flea_diag.operator.alarm import REPLAY, Alarm, AlarmAction, Comment, Key
from flea_diag.operator.state import MOST_TIMES
from flea_diag.wire.records import NEVER_NS, Remark, RemarkKind

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
LONGEST_TEXT = 2000
LONGEST_NAME = 100
MOST_COMMENTS = 1000
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
        self._file, self._stand, self._say = JournalFile(path, say), stand, say
        self._broken: set[Any] = set()

    @property
    def openings(self) -> int:
        """Times that a file was opened: above one, alarms known before are missing in it."""
        return self._file.openings

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def note(self, alarm: Alarm) -> None:
        """Store the recorded content of an alarm; acknowledgement and comments are kept."""
        self._file.rows(
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
        self._file.rows(
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
            self._file.rows(
                "UPDATE alarm SET acknowledged_ns = -1, acknowledged_by = '' WHERE stand = ? "
                "AND source = ? AND detected_ns = ? AND acknowledged_ns <= ?",
                (self._stand, *key, remark.stamp_ns),
            )
        said = remark.author[:LONGEST_NAME], remark.text.strip()[:LONGEST_TEXT], remark.until_ns
        self._file.rows(
            "INSERT INTO action VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
            (self._stand, *key, remark.stamp_ns, remark.kind.value, *said),
        )

    def service(self) -> AlarmAction | None:
        """What was last done to all alarms of the stand."""
        return next(reversed(self._actions(SERVICE)), None)

    def _actions(self, key: Key) -> tuple[AlarmAction, ...]:
        rows = self._file.rows(
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
        self._file.rows(
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
        rows = self._file.rows(
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
        rows = self._file.rows(
            "SELECT detected_ns FROM alarm WHERE stand = ? ORDER BY detected_ns DESC LIMIT ?",
            (self._stand, most),
        )
        return tuple(row[0] for row in rows)

    def waiting(self) -> int:
        """Number of alarms that nobody has acknowledged."""
        rows = self._file.rows(
            f"SELECT count(*) FROM alarm WHERE stand = ? AND {WAITS}", (self._stand,)
        )
        return int(rows[0][0])

    def marks(self, most: int = 100) -> tuple[Comment, ...]:
        """The latest marks, oldest first."""
        return self._comments(MARK)[-most:]

    def version(self) -> int:
        """Version number that changes when another process has written to the file."""
        return int(self._file.rows("PRAGMA data_version")[0][0])

    def _comments(self, key: Key) -> tuple[Comment, ...]:
        rows = self._file.rows(
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
                        f"journal {self._file.path}: a row cannot be read ({shown(key)}: "
                        f"{error}), it and others like it are left out"
                    )
