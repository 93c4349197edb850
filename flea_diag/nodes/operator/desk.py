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

"""Live state of one stand with its alarm journal, shared by console and page.

Records arrive in one thread; a screen may draw and accept input in another. The state is frozen
and replaced as a whole, so reading it needs no lock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.nodes.operator.alarm_journal import AlarmJournal, default_path
from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.fault_entry import FaultEntry, NoFaults
from flea_diag.operator.journal_state import as_of, with_journal, with_losses
from flea_diag.operator.state import MOST_ALARMS, SHOWN, OperatorState, aged, fold
from flea_diag.operator.unit_decision import decision, unit_in_question
from flea_diag.wire.bus import Bus
from flea_diag.wire.records import NEVER_NS, Record, Remark, RemarkKind, Scan

TICK_S = 0.5
DAQ = "daq"
SAID = (Remark,)
"""Published records: remarks of operators go to the recorder and to all other screens."""


def open_journal(path: str, bus: Bus[Any]) -> AlarmJournal:
    """Open the journal of a stand; an empty path is the default file."""
    return AlarmJournal(Path(path) if path else default_path(), bus.stand, bus.caution)


class Desk:
    """Folds records into the state, and stores alarms and the operators' remarks.

    Parameters
    ----------
    journal
        File for alarms, acknowledgements and comments.
    author
        Name stored with acknowledgements and comments made here.
    """

    def __init__(self, journal: AlarmJournal, author: str) -> None:
        self._journal, self._author = journal, author
        self._lock = threading.RLock()
        self._noted: dict[Key, Alarm] = {}
        self._version = self._openings = -1
        self._unsaid = False
        self.trouble = ""
        self.on_record: list[Callable[[Record], None]] = []
        self.on_remark: list[Callable[[Remark], None]] = []
        self.faults: FaultEntry = NoFaults()
        self.state = OperatorState()
        self.tick()

    @staticmethod
    def now_ns() -> int:
        """Arrival clock, monotonic: setting the system clock makes no stream stale."""
        return time.monotonic_ns()

    def take(self, record: Record) -> None:
        """Fold in a record; remarks made on other screens are stored here, too."""
        if isinstance(record, Remark):
            self._hear(record)
            return
        with self._lock:
            before = self.state.alarms
            self.state = fold(self.state, record, self.now_ns())
            if self.state.alarms is not before:
                self._note()
        for call in self.on_record:
            call(record)

    def tick(self, lost: Mapping[str, int] | None = None) -> None:
        """Update for elapsed time, other screens' entries and lost messages (count by topic)."""
        with self._lock:
            self.state = with_losses(aged(self.state, self.now_ns()), lost or {})
            self._note()
            self._kept(self._read)
            if self._unsaid:
                self._unsaid = not self._kept(self._count)
            self.state = as_of(self.state, time.time_ns())

    def _note(self) -> None:
        if self._openings != self._journal.openings:
            # A fresh file has taken the place of a damaged one.
            self._openings = self._journal.openings
            self._noted = {}
        for alarm in self.state.alarms:
            if self._noted.get(alarm.key) is not alarm and self._kept(self._journal.note, alarm):
                self._unsaid = self._unsaid or alarm.key not in self._noted
                self._noted[alarm.key] = alarm

    def _count(self) -> None:
        """Take over how many alarms of the journal, also of those not shown, await somebody."""
        self.state = replace(self.state, waiting=self._journal.waiting())

    def _read(self) -> None:
        version = self._journal.version()
        if version != self._version:
            self._version = version
            self._reread()

    def _reread(self) -> None:
        journal = self._journal
        state = with_journal(
            self.state,
            journal.alarms(MOST_ALARMS, [alarm.detected_ns for alarm in self.state.alarms]),
            journal.marks(),
            journal.service(),
            journal.times(),
            journal.waiting(),
        )
        # At once: a screen would draw what is silenced or can be undone as if it were not.
        self.state = as_of(state, time.time_ns())
        self._noted = {alarm.key: alarm for alarm in self.state.alarms}

    def _kept(self, call: Callable[..., Any], *arguments: Any) -> bool:
        """Whether the journal call succeeded; a full disk must not stop the screen."""
        try:
            call(*arguments)
        except RecordingError as error:
            self.trouble = str(error)
            return False
        self.trouble = ""
        return True

    # -- operator actions

    def acknowledge(self, key: Key) -> None:
        """Acknowledge one alarm."""
        self._say(Remark(time.time_ns(), RemarkKind.ACKNOWLEDGED, self._author, "", *key))

    def acknowledge_all(self, keys: Sequence[Key]) -> None:
        """Acknowledge these alarms: those of a list that a person has seen."""
        now_ns = time.time_ns()
        done = (Remark(now_ns, RemarkKind.ACKNOWLEDGED, self._author, "", *key) for key in keys)
        self._say(*done)

    def withdraw(self, key: Key) -> None:
        """Withdraw the acknowledgement of one alarm; it rings again."""
        self._say(Remark(time.time_ns(), RemarkKind.WITHDRAWN, self._author, "", *key))

    def shelve(self, key: Key, minutes: int, reason: str) -> None:
        """Silence one alarm for so long, for a reason; 0 minutes: no longer."""
        now_ns = time.time_ns()
        kind = RemarkKind.SHELVED if minutes > 0 else RemarkKind.UNSHELVED
        until_ns = now_ns + minutes * 60 * 10**9 if minutes > 0 else NEVER_NS
        self._say(Remark(now_ns, kind, self._author, reason, *key, until_ns))

    def set_service(self, out: bool, reason: str) -> None:
        """Take all alarms of the stand out of service for a reason, or put them back."""
        kind = RemarkKind.OUT_OF_SERVICE if out else RemarkKind.IN_SERVICE
        self._say(Remark(time.time_ns(), kind, self._author, reason))

    def comment(self, key: Key, text: str) -> None:
        """Comment on one alarm."""
        self._say(Remark(time.time_ns(), RemarkKind.COMMENT, self._author, text, *key))

    def mark(self, text: str, stamp_ns: int = NEVER_NS) -> None:
        """Mark a moment; by default the present one."""
        at_ns = self.moment_ns() if stamp_ns == NEVER_NS else stamp_ns
        self._say(Remark(at_ns, RemarkKind.MARK, self._author, text))

    def decide_on_unit(self, text: str) -> None:
        """Accept the unit on the stand as healthy for this reason, or take that back."""
        unit = unit_in_question(self.state)
        if unit is not None and text.strip():
            self._say(decision(unit, text, self.moment_ns(), self._author))

    def moment_ns(self) -> int:
        """Present time by the clock of the stand: the stamp of the latest scan shown.

        A mark is then stored at the right place of the recording, also with another clock on this
        machine and in a replay. While no scans arrive it is the clock of this machine.
        """
        state = self.state
        if state.scan is None or state.silent(Scan, self.now_ns()):
            return time.time_ns()
        return state.scan.stamp_ns

    def _say(self, *remarks: Remark) -> None:
        silent = RemarkKind.COMMENT, RemarkKind.MARK
        said = [r for r in remarks if r.text.strip() or r.kind not in silent]
        self._hear(*said)
        for remark in said:
            for call in self.on_remark:
                call(remark)

    def _hear(self, *remarks: Remark) -> None:
        with self._lock:
            for remark in remarks:
                self._kept(self._journal.keep, remark)
            # What has just failed is still said: it is not read anew then.
            if not self.trouble:
                self._kept(self._reread)

    def close(self) -> None:
        """Close the journal."""
        with self._lock:
            self._note()
            self._journal.close()


def connect(bus: Bus[Any], desk: Desk, record_types: Sequence[type] = SHOWN) -> None:
    """Subscribe a desk to the records of the bus, all that are shown or some of them."""

    def tick() -> None:
        desk.tick({s.topic.name.lstrip("/"): s.lost for s in bus.streams.values()})

    desk.faults = bus.remote_parameter(DAQ, "inject")
    bus.advertise(*SAID)
    desk.on_remark.append(bus.publish)
    for record_type in (*record_types, *SAID):
        bus.subscribe(record_type, desk.take)
    bus.every(TICK_S, tick)
