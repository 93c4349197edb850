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

"""Limit checks, the baseline of every test stand: a channel beyond what nominal runs reached.

Scan in, Detection and AmbiguityGroup out. A limit says which channel, and nothing of why: the
group holds the faults of that channel's sensor and every fault of the plant that slow channels
can show.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from flea_diag.core.faults.fault import Fault
from flea_diag.stages.baselines.plain_verdict import plain_verdict
from flea_diag.wire.blocks import ScanBlock
from flea_diag.wire.records import Candidate, Detection, Outcome, Record, Scan

Limits = Mapping[str, tuple[float, float]]

MARGIN = 0.1
"""Limits lie this share of the nominal span beyond the nominal extremes."""
IN_A_ROW = 3
"""Scans beyond a limit before it counts: single spikes are no fault."""


def learned_limits(scans: Iterable[Scan]) -> dict[str, tuple[float, float]]:
    """Limits of every channel from nominal scans: their extremes and a margin."""
    extremes: dict[str, tuple[float, float]] = {}
    for scan in scans:
        for channel, value in zip(scan.channels, scan.values, strict=True):
            if math.isfinite(value):
                low, high = extremes.get(channel, (value, value))
                extremes[channel] = min(low, value), max(high, value)
    return {
        channel: (low - MARGIN * (high - low), high + MARGIN * (high - low))
        for channel, (low, high) in extremes.items()
    }


@dataclass
class _Beyond:
    scans: int = 0
    value: float = math.nan


class LimitCheckStage:
    """See the module's first lines. Latches on the first channel beyond its limits.

    Parameters
    ----------
    limits
        Channel -> lowest and highest value, SI.
    faults
        The catalogue: what may be behind a channel beyond its limits.
    """

    consumes: tuple[type, ...] = (Scan,)

    def __init__(self, limits: Limits, faults: Mapping[str, Fault]) -> None:
        self._limits = dict(limits)
        self._faults = faults
        self._beyond = {channel: _Beyond() for channel in limits}
        self._latched = False
        self._began = False

    def handle(self, record: Record) -> tuple[Record, ...]:
        """The verdict, where this scan changes it."""
        if not isinstance(record, Scan) or self._latched:
            return ()
        for channel, value in zip(record.channels, record.values, strict=True):
            if self._tripped(channel, value):
                return self._trip(record.stamp_ns, channel, value)
        if self._began:
            return ()
        self._began = True
        return (plain_verdict(record.stamp_ns, Outcome.NOMINAL, "all channels within limits"),)

    def handle_block(self, block: ScanBlock) -> tuple[Record, ...]:
        """The same of many scans."""
        return tuple(caused for scan in block.records() for caused in self.handle(scan))

    def finish(self) -> tuple[Record, ...]:
        """Nothing is held back."""
        return ()

    def _tripped(self, channel: str, value: float) -> bool:
        if channel not in self._limits:
            return False
        low, high = self._limits[channel]
        beyond = self._beyond[channel]
        beyond.scans = beyond.scans + 1 if value < low or value > high else 0
        return beyond.scans >= IN_A_ROW

    def _trip(self, stamp_ns: int, channel: str, value: float) -> tuple[Record, ...]:
        self._latched = True
        low, high = self._limits[channel]
        limit = high if value > high else low
        words = f"{channel} = {value:.6g} exceeds its limit {limit:.6g}"
        named = [
            name
            for name, fault in self._faults.items()
            if fault.channel == channel or (not fault.channel and fault.alternatives)
        ]
        # A limit weighs none against another: equal odds.
        members = tuple(Candidate(name, "", 1.0 / len(named), words) for name in named)
        outcome = Outcome.ISOLATED if len(members) == 1 else Outcome.INDISTINGUISHABLE
        return (
            Detection(stamp_ns, 1, True, channel, value, limit, "limit check"),
            plain_verdict(stamp_ns, outcome, words, members, stamp_ns),
        )
