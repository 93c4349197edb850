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

"""Tests of single sensors that were beyond their limits, and the faults that they leave."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from flea_diag.core.faults.fault import Fault
from flea_diag.core.isolation.isolation import (
    DEFINED_BY,
    IMMEDIATE_MODES,
    JUMP_MODES,
    OWN_TESTS,
)
from flea_diag.wire.blocks import ResidualBlock

STEP = "step"


class SensorAlarms:
    """Which tests of which sensors have responded, and in which direction."""

    def __init__(self, tests: Collection[str], faults: Mapping[str, Fault]) -> None:
        self._tests, self._faults = frozenset(tests), faults
        self._seen: dict[tuple[str, str], str] = {}

    def __bool__(self) -> bool:
        """Whether any has responded."""
        return bool(self._seen)

    @property
    def faults(self) -> frozenset[str]:
        """Faults that one of these tests defines."""
        return frozenset(name for name, f in self._faults.items() if f.mode in DEFINED_BY)

    @property
    def are_steps(self) -> bool:
        """Whether nothing but steps of positions has been seen: these may have any size."""
        return all(test == STEP for _, test in self._seen)

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
            if name in self._tests:
                channel, _, test = name.rpartition("_")
                key = (channel, test) if test in OWN_TESTS else (name, STEP)
                at = int(beyond[:, column].argmax())
                first, value = min(first, scans.start + at), z[at, column]
                self._seen.setdefault(key, "+" if value > 0.0 else "-")
        return first

    def allowed(self) -> tuple[str, ...]:
        """Faults that fit what has responded, all of it if any does."""
        counts = {name: sum(self._fits(f, *s) for s in self._seen.items())
                  for name, f in self._faults.items()}  # fmt: skip
        most = max(counts.values(), default=0)
        return tuple(name for name, count in counts.items() if count == most > 0)

    def _fits(self, fault: Fault, where: tuple[str, str], sign: str) -> bool:
        channel, test = where
        if fault.channel != channel:
            return False
        if test == STEP:  # noise and drop-outs are seen by their own tests by then
            return fault.mode in JUMP_MODES and fault.mode not in IMMEDIATE_MODES
        return OWN_TESTS[test].get(fault.mode, "0") in (sign, "*")
