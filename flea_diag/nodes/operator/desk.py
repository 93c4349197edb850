"""One stand as it is live, with its journal: what every screen has before it.

Records come in one thread, a screen may draw and take orders in another; the state is frozen
and replaced as a whole, so that reading it needs no lock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from flea_diag.errors import RecordingError
from flea_diag.nodes.operator.alarm_journal import AlarmJournal, default_path
from flea_diag.operator.alarm import Alarm, Key
from flea_diag.operator.fault_entry import FaultEntry, NoFaults
from flea_diag.operator.state import (
    SHOWN,
    OperatorState,
    aged,
    fold,
    with_journal,
    with_losses,
)
from flea_diag.wire.bus import Bus
from flea_diag.wire.records import NEVER_NS, Record, Remark, RemarkKind, Scan

TICK_S = 0.5
DAQ = "daq"
SAID = (Remark,)
"""What people say on one screen goes to the recorder and to all other screens."""


def open_journal(path: str, stand: str) -> AlarmJournal:
    """Journal of a stand in this file, or in the default one when the path is empty."""
    return AlarmJournal(Path(path) if path else default_path(), stand)


class Desk:
    """Folds records into the state, and keeps alarms and what people say to them.

    Parameters
    ----------
    journal
        Where alarms, acknowledgements and comments are kept.
    author
        Who acknowledges and comments here.
    """

    def __init__(self, journal: AlarmJournal, author: str) -> None:
        self._journal, self._author = journal, author
        self._lock = threading.RLock()
        self._noted: dict[Key, Alarm] = {}
        self._version = -1
        self.trouble = ""
        self.on_record: list[Callable[[Record], None]] = []
        self.on_remark: list[Callable[[Remark], None]] = []
        self.faults: FaultEntry = NoFaults()
        self.state = OperatorState()
        self.tick()

    @staticmethod
    def now_ns() -> int:
        """Clock of the arrivals: steady, so that a clock that is set makes no stream stale."""
        return time.monotonic_ns()

    def take(self, record: Record) -> None:
        """One more record; what people say on other screens is kept here, too."""
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
        """Take in what time, other screens and the middleware (losses by topic) have changed."""
        with self._lock:
            self.state = with_losses(aged(self.state, self.now_ns()), lost or {})
            self._note()
            self._kept(self._read)

    def _note(self) -> None:
        for alarm in self.state.alarms:
            if self._noted.get(alarm.key) is not alarm and self._kept(self._journal.note, alarm):
                self._noted[alarm.key] = alarm

    def _read(self) -> None:
        version = self._journal.version()
        if version != self._version:
            self._version = version
            self._reread()

    def _reread(self) -> None:
        self.state = with_journal(self.state, self._journal.alarms(), self._journal.marks())
        self._noted = {alarm.key: alarm for alarm in self.state.alarms}

    def _kept(self, call: Callable[..., Any], *arguments: Any) -> bool:
        """Whether the journal did it; a full disk must not take the screen away."""
        try:
            call(*arguments)
        except RecordingError as error:
            self.trouble = str(error)
            return False
        self.trouble = ""
        return True

    # -- what people do

    def acknowledge(self, key: Key) -> None:
        """Acknowledge one alarm."""
        self._say(Remark(time.time_ns(), RemarkKind.ACKNOWLEDGED, self._author, "", *key))

    def comment(self, key: Key, text: str) -> None:
        """Say something to one alarm."""
        self._say(Remark(time.time_ns(), RemarkKind.COMMENT, self._author, text, *key))

    def mark(self, text: str, stamp_ns: int = NEVER_NS) -> None:
        """Mark a moment, or this one."""
        at_ns = self.moment_ns() if stamp_ns == NEVER_NS else stamp_ns
        self._say(Remark(at_ns, RemarkKind.MARK, self._author, text))

    def moment_ns(self) -> int:
        """Stamp of now by the stand's own clock: that of the scan that people see.

        A mark then lies in the recording where it was meant, whatever this machine's clock says,
        and in a replay as well. While no scans come it is this machine's clock.
        """
        state = self.state
        if state.scan is None or state.silent(Scan, self.now_ns()):
            return time.time_ns()
        return state.scan.stamp_ns

    def _say(self, remark: Remark) -> None:
        if not remark.text.strip() and remark.kind is not RemarkKind.ACKNOWLEDGED:
            return
        self._hear(remark)
        for call in self.on_remark:
            call(remark)

    def _hear(self, remark: Remark) -> None:
        with self._lock:
            if self._kept(self._journal.keep, remark):
                self._kept(self._reread)

    def close(self) -> None:
        """Close the journal."""
        with self._lock:
            self._note()
            self._journal.close()


def connect(bus: Bus[Any], desk: Desk) -> None:
    """Have a desk take what comes on the bus."""

    def tick() -> None:
        desk.tick({s.topic.name.lstrip("/"): s.lost for s in bus.streams.values()})

    desk.faults = bus.remote_parameter(DAQ, "inject")
    bus.advertise(*SAID)
    desk.on_remark.append(bus.publish)
    for record_type in (*SHOWN, *SAID):
        bus.subscribe(record_type, desk.take)
    bus.every(TICK_S, tick)
