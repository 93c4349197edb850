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

"""Models of the faults of screw, motor and supply: the rows of the catalogue, differentiated."""

from __future__ import annotations

from collections.abc import Iterable

from flea_diag.core.faults.effect_row import SizeRow
from flea_diag.core.faults.fault import Fault
from flea_diag.core.likelihood.effects import EffectRules, Effects
from flea_diag.core.likelihood.symbolic_model import SymbolicModel
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import power_of
from flea_diag.core.symbolic.expression import Constant, symbols


def plant_models(fault: Fault, rules: EffectRules) -> Iterable[SymbolicModel]:
    """One model for each alternative of a fault, and for each roughness of it."""
    for row in fault.effects:
        sizes = tuple(size.bounds for size in row.sizes)
        effects = tuple(
            effect
            for index, size in enumerate(row.sizes)
            for effect in _effects(size, rules, index)
        )
        for roughness in row.roughness:
            yield SymbolicModel(fault.name, sizes, effects, roughness, row.vibration_only)


def supplied(fault: Fault, relations: RelationSet) -> frozenset[str]:
    """Predictions whose supply a fault changes, though none of its models says by how much.

    So a drag heats a nut, and a winding of a higher resistance itself.
    """
    sizes = [size for row in fault.effects for size in row.sizes]
    scaled = {name for size in sizes for name, _ in size.scales}
    changed = {name for size in sizes for name, _ in size.moves}
    changed |= {
        name
        for name, definition in relations.base.items()
        if any(power_of(physical, definition) for physical in scaled)
    }
    rows = relations.predictions
    return frozenset(row.name for row in rows if changed & set(symbols(row.supply)))


def _effects(size: SizeRow, rules: EffectRules, index: int) -> Effects:
    moved = {name: Constant(amount) for name, amount in size.moves}
    return (
        *rules.grown(moved, index),
        *rules.scaled(dict(size.scales), index),
        *(rules.opened(size.opens, index) if size.opens else ()),
        *(effect for name, drag in size.adds for effect in rules.added(name, drag, index)),
    )
