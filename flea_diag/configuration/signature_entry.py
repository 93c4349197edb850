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

"""Signature tables as plain values, for the disk cache: each distinct signature once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.fault_signature import FaultSignature
from flea_diag.core.signatures.signature import SignatureTable, Variant, table_of, ways


def plain(tables: Sequence[SignatureTable]) -> dict[str, Any]:
    """``signatures``, and by table, fault, variant and residual the index of its own."""
    places: dict[FaultSignature, int] = {}
    tables_of_places = [
        [
            [[places.setdefault(s, len(places)) for s in v.row.values()] for v in variants]
            for variants in table.variants.values()
        ]
        for table in tables
    ]
    return {"signatures": [_fields(s) for s in places], "tables": tables_of_places}


def _fields(s: FaultSignature) -> list[Any]:
    return [s.magnitude, s.slope, s.order, s.path, s.derivatives, s.strength]


def tables(
    content: Mapping[str, Any],
    quadrants: Sequence[Quadrant],
    faults: Mapping[str, Fault],
    residuals: Sequence[str],
    period_s: float,
) -> dict[Quadrant, SignatureTable]:
    """Tables of what ``plain`` has made for the same quadrants, faults and residuals."""
    known = [FaultSignature(*entry) for entry in content["signatures"]]

    def variants(fault: Fault, rows: Sequence[Sequence[int]]) -> tuple[Variant, ...]:
        return tuple(
            Variant(
                group, dict(zip(residuals, map(known.__getitem__, row), strict=True)), each.onset
            )
            for (group, each), row in zip(ways(fault), rows, strict=True)
        )

    def table(quadrant: Quadrant, rows: Sequence[Any]) -> SignatureTable:
        of_faults = zip(faults.items(), rows, strict=True)
        found = {name: variants(fault, own) for (name, fault), own in of_faults}
        return table_of(quadrant, residuals, found, period_s)

    return {q: table(q, rows) for q, rows in zip(quadrants, content["tables"], strict=True)}
