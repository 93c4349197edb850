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

"""Order of the stamps of streams: a new run, or a single wrong stamp."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from flea_diag.nodes.health import HealthReport
from flea_diag.stages.stream.stream_order import BACK_NS, FOLLOWERS
from flea_diag.wire.records import Record, Residual, Scan, VibrationBlock, VibrationLevel

STREAMS: tuple[type, ...] = (VibrationBlock, Scan, Residual, VibrationLevel)
"""Records with increasing stamps. Latched records are excluded: they may be of any age."""


class StreamStamps:
    """Latest stamp of each stream; holds records back whose stamps step back.

    Parameters
    ----------
    health
        Told of each record of a stream, and of those that are accepted.
    new_run
        Called before the records of a new run are due, with the reason in words and the stamp of
        its first record.
    """

    def __init__(self, health: HealthReport, new_run: Callable[[str, int], None]) -> None:
        self._health, self._new_run = health, new_run
        self._latest_ns: dict[type, int] = {}
        self._held: list[Record] = []
        """Records received since their stamps stepped back, in order of arrival."""

    def due(self, record: Record) -> tuple[Record, ...]:
        """Records to handle now; a record that steps back waits until a new run is confirmed.

        A waiting record does not refresh the verdict of the previous run: it remains stale.
        """
        kind, stamp_ns = type(record), record.stamp_ns
        if kind not in STREAMS:
            return (record,)
        latest_ns = self._latest_ns.get(kind, stamp_ns)
        self._health.arrived(kind, stamp_ns, stamp_ns < latest_ns)
        if stamp_ns >= latest_ns - BACK_NS:
            self._latest_ns[kind] = stamp_ns if stamp_ns > latest_ns else latest_ns
            self._health.taken()
            if not self._held:
                return (record,)
            refuted = [held for held in self._held if type(held) is kind]
            self._held = [held for held in self._held if type(held) is not kind]
            return (*refuted, record)
        self._held.append(record)
        if sum(type(held) is kind for held in self._held) < FOLLOWERS:
            return ()
        back_s = (latest_ns - stamp_ns) / 1e9
        return self._begun(f"{kind.__name__} stamps stepped back by {back_s:.1f} s")

    def goes_on(self, stamps_ns: list[int]) -> bool:
        """Whether scans with these stamps go on where the last ended; if so, they are accepted."""
        latest_ns = self._latest_ns.get(Scan, stamps_ns[0])
        rising = all(a < b for a, b in pairwise((latest_ns - 1, *stamps_ns)))
        if self._held or not rising:
            return False
        self._health.arrived(Scan, stamps_ns[0], late=False)
        self._health.taken()
        self._latest_ns[Scan] = stamps_ns[-1]
        return True

    def forget(self) -> None:
        """Forget the stamps of the run so far."""
        self._latest_ns.clear()

    def _begun(self, why: str) -> tuple[Record, ...]:
        """Begin a run with the records held back; all of them are due."""
        held, self._held = tuple(self._held), []
        self._new_run(why, held[0].stamp_ns)
        self._health.taken()
        for record in held:
            self._latest_ns[type(record)] = record.stamp_ns
        return held
