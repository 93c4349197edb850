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

"""A bag flown through live nodes: its source records are sent, what is decided on them is kept.

Every flight has a range of stamps of its own, an hour before the one of the flight before. Its
records are told from all others by that range alone, however late or how often they arrive: a
verdict that is repeated, a latched record, a residual on its way. To the nodes a flight is a new
run, for the stamps have jumped back.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import fields, is_dataclass, replace
from functools import partial
from typing import Any

from flea_diag.stages.digest import DECISIONS, digest
from flea_diag.tools.replay.recorded import completed
from flea_diag.wire.records import (
    NEVER_NS,
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    FeatureRequest,
    FeatureValue,
    Hypotheses,
    Record,
    Residual,
    Scan,
    VibrationBlock,
)
from support.live import LIMIT_S, Peer

SOURCES = (ChannelTable, VibrationBlock, Scan)
IN_FLIGHT = 50
"""Scans sent and not yet answered by a residual: half of what a reader may leave waiting."""
ANSWER_S = 1.0
"""An introduction that is not answered by then was sent before somebody knew of us."""
TICK_NS = 10_000_000
HOUR_NS = 3_600_000_000_000
START_NS = 1_700_000_000_000_000_000
"""A bag's own stamps do not matter to when it is flown, so that bags may be flown in any order."""


def moved(value: Any, by_ns: int) -> Any:
    """The same record with every stamp in it moved by ``by_ns``, also those of its parts."""
    if isinstance(value, tuple):
        return tuple(moved(part, by_ns) for part in value)
    if not is_dataclass(value) or isinstance(value, type):
        return value
    changed: dict[str, Any] = {}
    for entry in fields(value):
        part = getattr(value, entry.name)
        if not entry.name.endswith("_ns"):
            changed[entry.name] = moved(part, by_ns)
        elif part != NEVER_NS:
            changed[entry.name] = part + by_ns
    return replace(value, **changed)


class Flight:
    """Sends source records to nodes, one flight after the other.

    Parameters
    ----------
    peer
        Guest on the bus that the nodes are on.
    hearing
        Records that somebody must subscribe to before anything is sent, each as often as it
        is named.
    """

    def __init__(self, peer: Peer, hearing: tuple[type, ...] = SOURCES) -> None:
        self._peer = peer
        self._bus = peer.bus
        self._flown = 0
        self._first_ns = self._last_ns = self._answered_ns = 0
        peer.listen(DataQuality, Hypotheses, *DECISIONS)
        # We hear what nodes tell each other, too: the other one is the node.
        wanted = {kind: 1 if kind in SOURCES else 2 for kind in hearing} | {
            Scan: hearing.count(Scan)
        }
        self._bus.subscribe(Residual, self._note)
        peer.until(lambda: all(self._bus.subscribers(k) >= n for k, n in wanted.items()))
        assert self._bus.wait_for_subscribers(*SOURCES, timeout_s=LIMIT_S)

    def introduce(self, scan: Scan) -> None:
        """Send this scan, later than any flight, until the last stage says what it sees.

        Nodes that we hear need not hear us or each other yet: what nobody answers is sent anew.
        Only before the first flight. After one, a scan that is an hour ahead of it is a single
        wrong stamp to the observer, which passes it over, and nobody would ever answer.
        """
        assert not self._flown, "the nodes know each other since the first flight"
        end_s = time.monotonic() + LIMIT_S
        for number in itertools.count(1):
            sent = replace(scan, stamp_ns=START_NS + number * TICK_NS)
            self._expect(sent.stamp_ns, sent.stamp_ns)
            self._bus.publish(sent)
            self._bus.wait_until(partial(self._has_answered, sent), ANSWER_S)
            if any(isinstance(record, AmbiguityGroup) for record in self._peer.records):
                return
            assert time.monotonic() < end_s, f"{number} scans, and no verdict on any"

    def fly(self, records: list[Record], rate: float | None = None) -> list[Record]:
        """Send the records; the scans with all that was decided on them.

        Parameters
        ----------
        records
            Of the sources, in the order of their recording.
        rate
            Times real time; as fast as they are answered where it is None.
        """
        first_ns = next(record.stamp_ns for record in records if isinstance(record, Scan))
        self._flown += 1
        away_ns = START_NS - self._flown * HOUR_NS - first_ns
        flown = [moved(record, away_ns) for record in records]
        scans = [record for record in flown if isinstance(record, Scan)]
        self._peer.records.clear()
        self._expect(scans[0].stamp_ns, scans[-1].stamp_ns)
        sent = itertools.count()
        start_s = time.monotonic()
        for record in flown:
            if rate is not None:
                self._wait_until(start_s + (record.stamp_ns - self._first_ns) / 1e9 / rate)
            if isinstance(record, Scan) and (number := next(sent)) >= IN_FLIGHT:
                self._answered(scans[number - IN_FLIGHT])
            self._bus.publish(record)
        self._answered(scans[-1])
        self._peer.until(self._is_over)
        return [moved(record, -away_ns) for record in (*scans, *self._said())]

    def _expect(self, first_ns: int, last_ns: int) -> None:
        """From now on a record with a stamp in this range belongs to what is sent."""
        self._first_ns, self._last_ns, self._answered_ns = first_ns, last_ns, 0

    def _is_of_it(self, record: Record) -> bool:
        return self._first_ns <= record.stamp_ns <= self._last_ns

    def _note(self, residual: Residual) -> None:
        if self._is_of_it(residual):
            self._answered_ns = max(self._answered_ns, residual.stamp_ns)

    def _wait_until(self, due_s: float) -> None:
        # The pace of a stand, as the stamps have it; the bus is served meanwhile.
        self._peer.until(lambda: time.monotonic() >= due_s)

    def _answered(self, scan: Scan) -> None:
        self._peer.until(partial(self._has_answered, scan))

    def _has_answered(self, scan: Scan) -> bool:
        return self._answered_ns >= scan.stamp_ns

    def _said(self) -> list[Record]:
        """What was said of it, each verdict with its hypotheses."""
        return completed(record for record in self._peer.records if self._is_of_it(record))

    def _is_over(self) -> bool:
        """The source is known to be silent, and the last verdict has been repeated since."""
        said = self._said()
        last = [r for r in said if isinstance(r, AmbiguityGroup)][-2:]
        asked = {(r.episode, r.step) for r in said if isinstance(r, FeatureRequest)}
        told = {(r.episode, r.step) for r in said if isinstance(r, FeatureValue)}
        return (
            asked == told
            and not any(isinstance(r, AmbiguityGroup) and r.summary for r in said)
            and len(last) == 2
            and all(group.stale for group in last)
            and digest(last[:1]) == digest(last)
        )
