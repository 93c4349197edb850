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

"""A diagnoser of others as a stage: scans go to its process, its answers become verdicts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

from flea_diag.errors import DiagnoserError, shown
from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.tools.arena.child import Child
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Candidate, Detection, Outcome, Record, Scan

UNKNOWN = "unknown"
"""An answer that there is a fault, and that it is none of the catalogue."""
PROTOCOL = 1
MOST_WEIGHT = 1e9


class ForeignStage:
    """One run of a diagnoser of others.

    Parameters
    ----------
    child
        Its process.
    told
        What it is told of the stand: name, channels with units, period, faults.
    nominal
        Columns of nominal recordings, for those that learn.

    Raises
    ------
    DiagnoserError
        It fails at its start.
    """

    consumes: tuple[type, ...] = (Scan,)

    def __init__(
        self, child: Child, told: Mapping[str, Any], nominal: Sequence[Mapping[str, Any]] = ()
    ) -> None:
        self._child, self._faults = child, tuple(told["faults"])
        self._start_ns: int | None = None
        self._stamp_ns = 0
        self._episode, self._open = 0, False
        self._said: dict[str, float] | None = None
        begun = child.ask({"kind": "start", "protocol": PROTOCOL, "stand": dict(told)})
        if begun.get("learns"):
            for columns in nominal:
                child.ask({"kind": "nominal", "columns": dict(columns)})
            child.ask({"kind": "learn"})

    @property
    def cpu_s(self) -> float:
        """Processor time of the process, once it has ended."""
        return self._child.cpu_s

    @property
    def peak_bytes(self) -> int:
        """Peak resident memory of the process, once it has ended."""
        return self._child.peak_bytes

    def close(self) -> None:
        """End the process."""
        self._child.close()

    def handle(self, record: Record) -> tuple[Record, ...]:
        """The verdict, where this scan changes the answer."""
        if not isinstance(record, Scan):
            return ()
        first = self._start_ns is None
        if self._start_ns is None:
            self._start_ns = record.stamp_ns
        self._stamp_ns = record.stamp_ns
        read = zip(record.channels, record.values, strict=True)
        values = {name: value if math.isfinite(value) else None for name, value in read}
        time_s = (record.stamp_ns - self._start_ns) / 1e9
        said = self._answer(self._child.ask({"kind": "scan", "time_s": time_s, "values": values}))
        if first and not said:
            return (*said, plain_verdict(record.stamp_ns, Outcome.NOMINAL, "no fault reported"))
        return said

    def handle_block(self, block: ScanBlock) -> tuple[Record, ...]:
        """The same of many scans."""
        return tuple(caused for scan in block.records() for caused in self.handle(scan))

    def finish(self) -> tuple[Record, ...]:
        """The last answer; the process ends."""
        said = self._answer(self._child.ask({"kind": "end"}))
        self.close()
        return said

    def _answer(self, reply: Mapping[str, Any]) -> tuple[Record, ...]:
        """Records of a new answer; none where it is as before, or there is none."""
        if reply.get("faults") is None:
            return ()
        said = self._checked(reply["faults"])
        if said == self._said:
            return ()
        self._said = said
        return self._verdict(said)

    def _checked(self, answer: Any) -> dict[str, float]:
        """Weights that sum to 1, the largest first."""
        if not isinstance(answer, dict):
            raise DiagnoserError(f"faults = {shown(answer)}: a mapping of faults to weights")
        for fault, weight in answer.items():
            if fault not in self._faults and fault != UNKNOWN:
                close = get_close_matches(str(fault), self._faults, 1)
                hint = f", did you mean {close[0]}?" if close else ""
                raise DiagnoserError(f"answered {shown(fault)}, no fault of this stand{hint}")
            sound = isinstance(weight, int | float) and not isinstance(weight, bool)
            if not sound or not 0.0 <= weight <= MOST_WEIGHT:
                raise DiagnoserError(
                    f"gave {fault} the weight {shown(weight)}: 0 or more is needed"
                )
        total = sum(answer.values())
        if answer and not total > 0.0:
            raise DiagnoserError("gave all faults the weight 0: answer no faults instead")
        ranked = sorted(answer.items(), key=lambda entry: (-entry[1], entry[0]))
        return {fault: weight / total for fault, weight in ranked if weight > 0.0}

    def _verdict(self, said: dict[str, float]) -> tuple[Record, ...]:
        stamp_ns = self._stamp_ns
        if not said:
            self._open = False
            return (plain_verdict(stamp_ns, Outcome.NOMINAL, "no fault reported"),)
        begun: tuple[Record, ...] = ()
        if not self._open:
            self._open, self._episode = True, self._episode + 1
            self._detected_ns = stamp_ns
            begun = (Detection(stamp_ns, self._episode, True, "", 1.0, 1.0, "answer"),)
        members = tuple(Candidate(f, "", w, "as answered") for f, w in said.items() if f != UNKNOWN)
        outcome = Outcome.ISOLATED if len(members) == 1 else Outcome.INDISTINGUISHABLE
        words = f"answered {', '.join(said)}"
        if UNKNOWN in said:
            members, outcome = (), Outcome.UNEXPLAINED
        group = plain_verdict(stamp_ns, outcome, words, members, self._detected_ns)
        return (*begun, replace(group, episode=self._episode))
