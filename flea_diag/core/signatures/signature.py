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

"""Fault signature tables: deviation of each residual under each single fault.

Two tables share one interface: the initial one follows from the temporal causal graph, the
sampled one from the discretised model; it is what a diagnoser at the scan rate observes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.causal_graph.operating_point import Quadrant, operating_values
from flea_diag.core.faults.fault import Alternative, Fault
from flea_diag.core.faults.fault_signature import (
    UNAFFECTED,
    Compatibility,
    FaultSignature,
    compatible,
)
from flea_diag.core.signatures.initial_signature import TextbookColumns
from flea_diag.core.signatures.sampled_response import SampledColumns

__all__ = [
    "Compatibility",
    "FaultSignature",
    "SignatureTable",
    "Variant",
    "compatible",
    "signature_table",
    "table_of",
    "ways",
]


SPEEDS = (0.1, 1.0, 10.0)
"""Shares of the held speed at which a relation must deviate the same way: of a motor that brakes no
quadrant says whether resistance or back-EMF takes more of the voltage."""


@dataclass(frozen=True)
class Variant:
    """One alternative of a fault with its signature in every residual."""

    hypotheses: Alternative
    row: Mapping[str, FaultSignature]
    onset: str = "abrupt"

    def __str__(self) -> str:
        return ", ".join(map(str, self.hypotheses)) or "no slow channel"


SignatureRow = Mapping[str, FaultSignature]


@dataclass(frozen=True)
class SignatureTable(Mapping[str, SignatureRow]):
    """Fault id -> residual name -> signature, in one quadrant.

    A fault has one variant per alternative (a bias may be positive or negative); its row merges
    them, with ``*`` where they differ (a common direction is kept). A fault is consistent when
    one of its variants is consistent in all residuals.
    """

    quadrant: Quadrant
    residuals: tuple[str, ...]
    variants: Mapping[str, tuple[Variant, ...]]
    rows: Mapping[str, SignatureRow]
    period_s: float = 0.0
    """Sampling period that the table is for, 0 for the textbook (continuous) one."""

    def __getitem__(self, fault: str) -> SignatureRow:
        return self.rows[fault]

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)


def merged(variants: Sequence[SignatureRow], residuals: Iterable[str]) -> SignatureRow:
    """One row for several alternatives: common signs, ``*`` where they differ."""
    if not variants:
        return MappingProxyType(dict.fromkeys(residuals, UNAFFECTED))
    return MappingProxyType({name: _merge([v[name] for v in variants]) for name in residuals})


def _merge(found: Sequence[FaultSignature]) -> FaultSignature:
    first = found[0]
    if all(s.symbols == first.symbols for s in found):
        return first
    shown = [s for s in found if s.affected]
    directions = {s.direction for s in shown}
    direction = directions.pop() if len(directions) == 1 else "*"
    path = " | ".join(dict.fromkeys(s.path for s in shown))
    order, strength = min(s.order for s in shown), max(s.strength for s in shown)
    return FaultSignature(direction, "*", order, path, strength=strength)


def signature_table(
    model: Actuator,
    faults: Mapping[str, Fault],
    residuals: Sequence[str],
    quadrant: Quadrant,
    period_s: float | None = None,
) -> SignatureTable:
    """Signatures of faults in residuals, in one quadrant.

    Parameters
    ----------
    model
        The actuator with the sensors that the stand has (``with_sensors``).
    residuals
        Names from its description.
    period_s
        None: initial signatures in continuous time, from the temporal causal graph. A scan
        period in s: signatures at that rate, computed from the discretised model.

    Raises
    ------
    ModelError
        A residual that these sensors do not suffice for.
    """
    values = operating_values(model, quadrant)
    specs = [model.residuals[name] for name in residuals]
    columns: TextbookColumns | SampledColumns = (
        TextbookColumns(model, values)
        if period_s is None
        else SampledColumns(model, values, period_s)
    )
    anywhere = [
        TextbookColumns(model, operating_values(model, quadrant, speed=share)) for share in SPEEDS
    ]

    def cell(spec: ResidualSpec, fault: Fault, group: Alternative) -> FaultSignature:
        found = columns.cell(spec, fault, group)
        if spec.predicts or not found.affected:
            return found
        ways = {each.cell(spec, fault, group).direction for each in anywhere}
        return found if len(ways) == 1 else replace(found, magnitude="*", slope="*")

    variants = {
        name: tuple(
            Variant(group, {s.name: cell(s, each, group) for s in specs}, each.onset)
            for group, each in ways(fault)
        )
        for name, fault in faults.items()
    }
    return table_of(quadrant, residuals, variants, period_s or 0.0)


def ways(fault: Fault) -> Iterator[tuple[Alternative, Fault]]:
    """Each alternative of a fault with each of its onsets: the variants of its row, in order."""
    for group in fault.alternatives:
        for each in fault.onsets:
            yield group, each


def table_of(
    quadrant: Quadrant,
    residuals: Sequence[str],
    variants: Mapping[str, tuple[Variant, ...]],
    period_s: float,
) -> SignatureTable:
    """Table of these variants, with the row of each fault."""
    rows = {name: merged([v.row for v in found], residuals) for name, found in variants.items()}
    return SignatureTable(quadrant, tuple(residuals), variants, rows, period_s)
