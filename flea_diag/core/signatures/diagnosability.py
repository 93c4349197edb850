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

"""Diagnosability: which faults the residuals isolate from each other, before any measurement.

Fault f is isolated from g when, for every pair of their alternatives, some residual in some
quadrant shows a sign under f that g excludes. A pair that no quadrant isolates is not isolable
with these sensors; a pair that only some quadrants isolate is isolated once the stand has been
in one of them (Narasimhan et al. 2010, section 3.3, offline stage).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.causal_graph.operating_point import QUADRANTS, Quadrant
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.fault_signature import FaultSignature, compatible
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.signatures.signature import SignatureTable, Variant, signature_table
from flea_diag.errors import ModelError


@dataclass(frozen=True)
class Refutation:
    """One residual in one quadrant that refutes ``other`` when ``fault`` is present.

    ``by`` is the reason: ``support`` (the other fault does not affect this residual), ``sign``
    (it has the opposite sign) or ``slope``.
    """

    fault: str
    other: str
    residual: str
    quadrant: Quadrant
    by: str
    shown: str
    forbidden: str

    def __str__(self) -> str:
        return (
            f"{self.residual} at {self.quadrant}: {self.fault} shows {self.shown},"
            f" {self.other} would show {self.forbidden} ({self.by})"
        )


@lru_cache(maxsize=4096)
def refutes(shown: str, predicted: str) -> str:
    """How an effect with symbols ``shown`` refutes predicted ones, empty when it does not.

    What is open (``*``) in the effect may turn out either way, so it refutes only a fault
    that does not affect the residual at all.
    """
    effect = FaultSignature(shown[0], shown[1], 0, "")
    expected = FaultSignature(predicted[0], predicted[1], 0, "")
    if not effect.affected:
        return ""
    if not expected.affected:
        return "support"
    if effect.direction == "*":
        return ""
    if not compatible(expected, effect.direction):
        return "sign"
    slope = "?" if effect.slope == "*" or effect.magnitude == "0" else effect.slope
    return "" if compatible(expected, effect.direction, slope) else "slope"


@dataclass(frozen=True)
class Diagnosability:
    """Result of the analysis for one sensor set: a table for each quadrant."""

    faults: tuple[str, ...]
    residuals: tuple[str, ...]
    tables: Mapping[Quadrant, SignatureTable]

    def splits(self, fault: str, other: str) -> tuple[Refutation, ...]:
        """Refutations that together isolate ``fault`` from ``other``; empty when not isolable.

        One for each pair of alternatives: all of them must be refuted.
        """
        found: list[Refutation] = []
        for ours in range(self._alternatives(fault)):
            for theirs in range(self._alternatives(other)):
                split = self._first_split(fault, ours, other, theirs)
                if split is None:
                    return ()
                found.append(split)
        return tuple(dict.fromkeys(found))

    def quadrants(self, fault: str, other: str) -> tuple[Quadrant, ...]:
        """Quadrants that isolate ``fault`` from ``other`` by themselves."""
        return tuple(
            quadrant
            for quadrant, table in self.tables.items()
            if Diagnosability(self.faults, self.residuals, {quadrant: table}).splits(fault, other)
        )

    @cached_property
    def ambiguity(self) -> dict[str, tuple[str, ...]]:
        """Fault -> the faults that its signature does not refute, itself included."""
        return {
            fault: tuple(g for g in self.faults if g == fault or not self.splits(fault, g))
            for fault in self.faults
        }

    @cached_property
    def undetectable(self) -> tuple[str, ...]:
        """Faults that affect no residual in any quadrant."""
        return tuple(
            fault
            for fault in self.faults
            if not any(s.affected for table in self.tables.values() for s in table[fault].values())
        )

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Faults with identical signatures in all quadrants: not isolable from each other."""
        rows: dict[tuple[object, ...], list[str]] = {}
        for fault in self.faults:
            rows.setdefault(self._fingerprint(fault), []).append(fault)
        return tuple(tuple(members) for members in rows.values())

    def verdict(self, fault: str, other: str, seen: Sequence[Quadrant] = ()) -> str:
        """In words: isolated, not yet isolated (and in which quadrant), or not isolable."""
        if not self.splits(fault, other):
            return f"{fault} and {other} are not isolable from each other with these sensors"
        here = {q: t for q, t in self.tables.items() if q in seen}
        now = Diagnosability(self.faults, self.residuals, here).splits(fault, other)
        if now:
            return f"isolated by {now[0]}"
        where = ", or ".join(map(str, self.quadrants(fault, other))) or "several quadrants together"
        return f"{fault} and {other} not yet isolated: move the stand to {where}"

    def _alternatives(self, fault: str) -> int:
        first = next(iter(self.tables.values()), None)
        return max(1, len(first.variants[fault])) if first else 0

    def _first_split(self, fault: str, ours: int, other: str, theirs: int) -> Refutation | None:
        for quadrant, table in self.tables.items():
            one, two = _row(table, fault, ours), _row(table, other, theirs)
            for name in self.residuals:
                shown, forbidden = one[name].symbols, two[name].symbols
                by = refutes(shown, forbidden)
                if by:
                    return Refutation(fault, other, name, quadrant, by, shown, forbidden)
        return None

    def _fingerprint(self, fault: str) -> tuple[object, ...]:
        return tuple(
            frozenset(self._symbols(v.row) for v in table.variants[fault])
            or frozenset({self._symbols(table[fault])})
            for table in self.tables.values()
        )

    def _symbols(self, row: Mapping[str, FaultSignature]) -> tuple[str, ...]:
        return tuple(row[name].symbols for name in self.residuals)


def _row(table: SignatureTable, fault: str, index: int) -> Mapping[str, FaultSignature]:
    variants: tuple[Variant, ...] = table.variants[fault]
    return variants[index].row if variants else table[fault]


def diagnosability(
    model: Actuator,
    faults: Mapping[str, Fault],
    residuals: Sequence[str] | None = None,
    period_s: float | None = None,
    quadrants: Sequence[Quadrant] = QUADRANTS,
) -> Diagnosability:
    """Analyse an actuator with its sensors; ``period_s`` as in ``signature_table``."""
    names = tuple(usable_residuals(model) if residuals is None else residuals)
    tables = {q: signature_table(model, faults, names, q, period_s) for q in quadrants}
    return Diagnosability(tuple(faults), names, tables)


def usable_residuals(model: Actuator) -> tuple[str, ...]:
    """Residuals of the description that this actuator's sensors suffice for."""
    return tuple(
        name for name, spec in model.residuals.items() if spec.signs and _usable(model, name)
    )


def _usable(model: Actuator, name: str) -> bool:
    if not model.residuals[name].balances:
        return True
    try:
        parity_relation(model, model.residuals[name])
    except ModelError:
        return False
    return True


@dataclass(frozen=True)
class ExtraSensor:
    """A sensor that is not fitted, and the refutations that it would add."""

    channel: str
    splits: tuple[Refutation, ...]


def extra_sensors(
    model: Actuator,
    sensors: Sequence[str],
    faults: Mapping[str, Fault],
    fault: str,
    other: str,
    period_s: float | None = None,
) -> tuple[ExtraSensor, ...]:
    """Sensors of the description, beyond those given, that would isolate one fault from another.

    Parameters
    ----------
    model
        The actuator with every sensor that could be fitted.
    sensors
        The channels that are fitted.
    """
    pair = {name: faults[name] for name in (fault, other)}
    found = []
    for channel in model.sensors:
        if channel in sensors:
            continue
        fitted = model.with_sensors([*sensors, channel])
        splits = diagnosability(fitted, pair, period_s=period_s).splits(fault, other)
        if splits:
            found.append(ExtraSensor(channel, splits))
    return tuple(found)
