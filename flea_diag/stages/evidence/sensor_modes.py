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

"""Modes of single sensors: what their own tests have shown, and what has not shown in time.

Noise, drop-outs and a reading that stands still are defined by a test of that sensor alone. A mode
is possible while all that has responded fits it; once the tests have had their time, its own must
be among them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from flea_diag.core.faults.fault import Fault
from flea_diag.core.frozen import Frozen
from flea_diag.core.isolation.predicted_symbols import DEFINED_BY, JUMP_MODES, OWN_TESTS
from flea_diag.stages.observer.detection_episode import QUIET
from flea_diag.wire.blocks import ResidualBlock
from flea_diag.wire.records import NEVER_NS

STEP = "step"
SHOWN_S = 1.0
"""Time after the first response in which a test of the same sensor shows what it is."""
MOVED_S = 0.5
"""Time for which a reading goes on moving that is not dead."""


@dataclass(frozen=True)
class ChannelMotion:
    """When a reading moves: its speed among the regressors, per unit of a slow motion, m/s."""

    signal: str
    slow: float


@dataclass(frozen=True, eq=False)
class SensorKnowledge(Frozen):
    """What the tests of single sensors say of the faults of a stand.

    Attributes
    ----------
    tests
        Names of the residuals that are tests of a single sensor.
    motion
        Channels of the motion.
    unseen
        Channels of which no test tells a dead one from one that stands still.
    stepping
        Faults of the plant with which a position steps against another one, as a play does.
    """

    tests: Collection[str]
    faults: Mapping[str, Fault]
    motion: Mapping[str, ChannelMotion]
    unseen: Collection[str]
    period_s: float
    stepping: Collection[str] = ()


class SensorModes:
    """Which tests of which sensors have responded, and the modes that fit; constant memory."""

    def __init__(self, knowledge: SensorKnowledge) -> None:
        self._k = knowledge
        self._seen: dict[tuple[str, str], str] = {}
        self._scans = 0
        self._moved = dict.fromkeys(knowledge.motion, 0)

    def __bool__(self) -> bool:
        """Whether any test has responded."""
        return bool(self._seen)

    @property
    def faults(self) -> frozenset[str]:
        """Faults that one of these tests defines and can show: the relations tell all others."""
        defined = ((name, f) for name, f in self._k.faults.items() if f.mode in DEFINED_BY)
        unseen = self._k.unseen
        return frozenset(n for n, f in defined if f.mode != "dead" or f.channel not in unseen)

    @property
    def words(self) -> str:
        """Channels and tests."""
        return ", ".join(f"{channel}: {test}{sign}" for (channel, test), sign in self._seen.items())

    def take(self, block: ResidualBlock, scans: slice) -> int:
        """Look at some scans of a block: the first of the block beyond a limit, or its length."""
        first = len(block)
        z, limits = block.z[scans], block.thresholds[scans]
        beyond = np.abs(z) > limits
        for column in np.flatnonzero(beyond.any(axis=0)).tolist():
            name = block.names[column]
            if name in self._k.tests:
                channel, _, test = name.rpartition("_")
                key = (channel, test) if test in OWN_TESTS else (name, STEP)
                at = int(beyond[:, column].argmax())
                first, value = min(first, scans.start + at), z[at, column]
                self._seen.setdefault(key, "+" if value > 0.0 else "-")
        if self:
            since = scans.start if self._scans else min(first, scans.stop)
            self._follow(block, slice(since, scans.stop))
        return first

    def loud_ns(self, block: ResidualBlock, scans: slice) -> int:
        """Stamp of the last of some scans at which a test is not quiet; never where all are."""
        columns = self._columns(block)
        loud = np.abs(block.z[scans, columns]) > QUIET * block.thresholds[scans, columns]
        at = np.flatnonzero(loud.any(axis=1))
        return int(block.stamps_ns[scans][at[-1]]) if at.size else NEVER_NS

    def beyond(self, block: ResidualBlock, scan: int) -> tuple[str, float, float]:
        """The test that is farthest beyond its limit at a scan: name, statistic and limit."""
        columns = self._columns(block)
        z, limits = block.z[scan, columns], block.thresholds[scan, columns]
        most = int(np.nanargmax(np.abs(z) / limits))
        return block.names[columns[most]], float(z[most]), float(limits[most])

    def _columns(self, block: ResidualBlock) -> list[int]:
        """Columns of these tests."""
        return [k for k, name in enumerate(block.names) if name in self._k.tests]

    def _follow(self, block: ResidualBlock, scans: slice) -> None:
        """Count scans since the first response, and those in which a reading moves."""
        self._scans += scans.stop - scans.start
        for channel, motion in self._k.motion.items():
            speed = block.regressors[scans, block.regressor_names.index(motion.signal)]
            self._moved[channel] += int((np.abs(speed) > motion.slow).sum())

    def possible(self) -> tuple[str, ...]:
        """Faults that fit what has responded, and have shown what defines them."""
        every = self._k.faults.items()
        counts = {name: sum(self._fits(f, *s) for s in self._seen.items()) for name, f in every}
        most = max(counts.values(), default=0)
        fitting = tuple(name for name, count in counts.items() if count == most > 0)
        return tuple(name for name in fitting if self._shows(self._k.faults[name])) or fitting

    def _shows(self, fault: Fault) -> bool:
        """Whether a fault has shown what defines it, or has not had the time to."""
        period_s, defining = self._k.period_s, DEFINED_BY.get(fault.mode, ())
        if fault.mode == "dead" and fault.channel in self._moved:
            return self._moved[fault.channel] * period_s < MOVED_S
        if not defining or fault.channel in self._k.unseen or self._scans * period_s < SHOWN_S:
            return True
        return any(self._seen.get((fault.channel, test)) == sign for test, sign in defining)

    def _fits(self, fault: Fault, where: tuple[str, str], sign: str) -> bool:
        """Whether a fault makes this test respond so."""
        channel, test = where
        if test == STEP and fault.name in self._k.stepping:
            return True
        if fault.channel != channel:
            return False
        if test == STEP:  # its own test may still be to come
            return fault.mode in JUMP_MODES
        return OWN_TESTS[test].get(fault.mode, "0") in (sign, "*")
