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

"""Structural isolation, the baseline without signs: which residuals react, and no more.

What fault detection and isolation by structural analysis uses of a model (Frisk et al. 2017):
a fault is connected to a residual or it is not. Held against the full tables it shows what the
signs of magnitude and slope are worth.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from flea_diag.core.faults.fault_signature import FaultSignature
from flea_diag.core.signatures.signature import SignatureRow, SignatureTable


def without_signs(table: SignatureTable) -> SignatureTable:
    """The same table with ``**`` wherever a fault shows, whichever way."""
    variants = {
        fault: tuple(replace(variant, row=_unsigned(variant.row)) for variant in found)
        for fault, found in table.variants.items()
    }
    rows = {fault: _unsigned(row) for fault, row in table.rows.items()}
    return replace(table, variants=MappingProxyType(variants), rows=MappingProxyType(rows))


def _unsigned(row: SignatureRow) -> SignatureRow:
    return MappingProxyType({name: _any_sign(cell) for name, cell in row.items()})


def _any_sign(cell: FaultSignature) -> FaultSignature:
    return replace(cell, magnitude="*", slope="*", derivatives="") if cell.affected else cell
