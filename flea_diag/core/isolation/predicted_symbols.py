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

"""What a fault predicts of a residual, and what must appear if it is there.

The signature tables of the quadrants say it for relations; a sensor's own faults act on the tests
of that sensor alone, and some of them are defined by such a test.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.fault_signature import UNAFFECTED, FaultSignature, compatible
from flea_diag.core.faults.sensor_symptoms import SensorSymptoms
from flea_diag.core.signatures.signature import SignatureTable

JUMP_MODES = ("bias", "scaling", "dead", "dropout", "noise")
"""Modes that step. The position of a mass cannot jump: no fault of the plant has an effect of order
0 on it, so only the sensor's own faults move the residual that is its step."""
OWN_TESTS: Mapping[str, Mapping[str, str]] = {
    "noise": {"noise": "+", "dropout": "*", "dead": "-"},
    "stuck": {"dead": "+"},
    "dropout": {"dropout": "+"},
}
"""Effect of the modes of a sensor fault on the tests of that sensor alone (``sensor_tests``)."""
DEFINED_BY = {
    "noise": (("noise", "+"),),
    "dropout": (("dropout", "+"),),
    "dead": (("stuck", "+"), ("noise", "-")),
}
"""Modes defined by such a test: ruled out if none of these symbols appears in time."""
IMMEDIATE_MODES = ("noise", "dropout")
"""Modes that the sensor's own test detects no later than any mean of a relation does; loss of noise
and held readings take longer."""


@dataclass(frozen=True, slots=True)
class PredictedSymbols:
    """Predictions of all faults of one catalogue."""

    tables: Mapping[Quadrant, SignatureTable]
    sensors: SensorSymptoms

    def judge(
        self,
        fault: Fault,
        residual: str,
        magnitude: str,
        slope: str,
        visited: tuple[Quadrant, ...],
    ) -> tuple[bool, FaultSignature, str]:
        """Whether a fault predicts a symbol in a quadrant visited; its signature and the words."""
        last = UNAFFECTED, "this fault does not affect this residual"
        for signature in self._predictions(fault, residual, visited):
            verdict = compatible(signature, magnitude, slope)
            if verdict:
                return True, signature, verdict.reason
            if signature.affected:
                last = signature, verdict.reason
        return False, *last

    def _predictions(
        self, fault: Fault, residual: str, visited: tuple[Quadrant, ...]
    ) -> Iterable[FaultSignature]:
        channel, _, test = residual.rpartition("_")
        if test in OWN_TESTS:
            yield _own(fault, (channel,), OWN_TESTS[test].get(fault.mode, "0"), test)
            return
        if residual in self.sensors.positions:
            yield _own(fault, (residual,), "*" if fault.mode in JUMP_MODES else "0", "jump")
            for quadrant in visited:
                yield from steps(fault, self.tables[quadrant], self.sensors)
            return
        if residual in self.sensors.own:
            yield _own(fault, self.sensors.own[residual], "*", "level")
            return
        for quadrant in visited:
            table = self.tables[quadrant]
            for variant in table.variants[fault.name]:
                if residual in variant.row:
                    yield variant.row[residual]

    def absent(
        self,
        fault: Fault,
        symbols: Mapping[str, str],
        moved: Collection[str],
        settled: bool = True,
        followed_s: float = math.inf,
    ) -> tuple[str, str, str] | None:
        """Source, symbol and words of what defines a fault and is absent; as of ``require``."""
        shown_s = self.sensors.death_s.get(fault.channel, 0.0)
        unseen = fault.channel in self.sensors.death_unseen or followed_s < shown_s
        if fault.mode == "dead" and unseen:
            return None
        defining = DEFINED_BY.get(fault.mode, ())
        tests = [f"{fault.channel}_{test}" for test, _ in defining]
        source, seen = (tests or [""])[0], [symbols.get(test, "0") for test in tests]
        if fault.mode == "dead" and fault.channel in self.sensors.motion:
            # A channel whose reading still follows the motion is not dead.
            source, words = fault.channel, f"{fault.channel} still follows the motion"
            ruled_out = fault.channel in moved
        else:
            words = f"{fault.channel} shows no symptom of {fault.mode}"
            wanted = [symbol for _, symbol in defining]
            timely = settled or self._shows_at_once(fault, symbols)
            ruled_out = timely and bool(defining) and not any(map(str.__eq__, seen, wanted))
        return (source, "".join(seen[:1]), words) if ruled_out else None

    def _shows_at_once(self, fault: Fault, symbols: Collection[str]) -> bool:
        """Whether the sensor's own test responds first: neither its jump nor a twin has deviated.

        Twins read one motion: faults of either show in their difference before its own test.
        """
        jumped = fault.channel in self.sensors.positions and fault.channel in symbols
        twins = any(name in symbols for name in self.sensors.twins)
        return fault.mode in IMMEDIATE_MODES and not jumped and not twins


def steps(fault: Fault, table: SignatureTable, sensors: SensorSymptoms) -> Iterator[FaultSignature]:
    """Of a fault of the plant with which the difference of two positions jumps: one steps."""
    for variant in () if fault.channel else table.variants[fault.name]:
        for twin in sensors.stretched:
            found = variant.row.get(twin, UNAFFECTED)
            if found.affected and found.order == 0:
                yield FaultSignature("*", "*", 0, found.path)


def _own(fault: Fault, channels: Collection[str], symbol: str, what: str) -> FaultSignature:
    """Signature of a residual that only the faults of its own sensors can move."""
    if fault.channel not in channels or symbol == "0":
        return UNAFFECTED
    return FaultSignature(symbol, "*", 0, f"{fault.name} -> {what} of {fault.channel}")
