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

"""Which way the truth lies of a relation that holds readings at a limit of their range.

A clipped reading says that there is at least so much. A relation of the circuit is a sum of
readings as they are, without rates, so the kernel that smooths them, which weighs none negatively,
leaves the sense of each: r is at least, or at most, what it would be with the truth. Where all
clipped readings agree on the side on which r lies, it has missed by at least r. A reading that
enters by a smooth sign alone, as the current does a voltage drop, says all of it at its limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.relation_set import RelationSet

Flags = npt.NDArray[np.bool_]
Signs = npt.NDArray[np.float64]


class Bounding:
    """How each channel enters the relations of the circuit of one stand.

    ``parameters``: base parameters by whose values the signs are told.
    """

    def __init__(self, relations: RelationSet, parameters: Any) -> None:
        rows = relations.residuals
        self._signs: dict[int, Signs] = {}
        """Column of a residual -> sign of d r / d reading, shape (channels,)."""
        self._with: dict[int, list[int]] = {}
        """The same column -> columns of all values of its relation."""
        for row in rows.parities:
            relation = relations.named.get(row.relation)
            if row.normalised or relation is None or rows.voltage not in relation.signals:
                continue
            signs = relations.reading_signs(parameters, row.relation)
            if signs is not None:
                column = rows.place[row.name]
                self._signs[column] = signs
                self._with[column] = rows.of_relations({row.relation})
        self.columns = frozenset(column for every in self._with.values() for column in every)
        """Of the residuals that clipped readings bound."""

    def leave_out(self, residuals: ResidualRows, clipped: Flags) -> None:
        """Drop what clipped readings may explain.

        ``clipped``: whether a channel was at its lower or its upper limit within a kernel, shape
        (n, 2, channels).
        """
        for column, signs in self._signs.items():
            low, high = clipped[:, 0], clipped[:, 1]
            above = (high & (signs > 0.0) | low & (signs < 0.0)).any(axis=1)
            below = (high & (signs < 0.0) | low & (signs > 0.0)).any(axis=1)
            missed = residuals.values[:, column]
            explained = (above & ~(missed > 0.0)) | (below & ~(missed < 0.0))
            residuals.leave_out(explained, self._with[column])
