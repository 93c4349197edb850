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

"""Faults not isolable from each other by the residuals.

A fault model adds a linear combination of regressors to each relation, its sizes being free. Two
models are not isolable in some relations when these combinations span the same space there: a bias
of the current moves the mechanical relation by K b and one of the load cell by -b, so that without
another relation each is the other. Bounds of sizes are left out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.residuals.residual_rows import ResidualSet

Array = npt.NDArray[np.float64]
Effects = dict[tuple[str, str, int], float]
"""Residual, regressor and number of the size -> gain."""


def computable(
    known: ResidualSet, residuals: Iterable[str], bad: Collection[str]
) -> tuple[str, ...]:
    """Of these residuals those that are left without the channels that are bad."""
    return tuple(name for name in residuals if not set(known.named[name].needs) & set(bad))


def isolable(
    models: Sequence[FaultModel], faults: Sequence[str], residuals: Collection[str]
) -> bool:
    """Whether these residuals isolate any of the faults from the first.

    A fault may have several models: it is not isolable where one model of each spans the same
    space.
    """
    spaces = [[_effects(m, residuals) for m in models if m.fault == fault] for fault in faults]
    return not all(
        any(_same_space(one, other) for one in spaces[0] for other in found) for found in spaces[1:]
    )


def _effects(model: FaultModel, residuals: Collection[str]) -> Effects:
    """Gain of each size on each regressor of these residuals."""
    found: Effects = {}
    for term in model.terms:
        if term.residual in residuals:
            key = term.residual, term.regressor, term.index
            found[key] = found.get(key, 0.0) + term.gain
    return found


def _same_space(one: Effects, other: Effects) -> bool:
    """Whether two sets of effects span the same space, and any at all."""
    if not one or not other:
        return False
    rows = sorted({key[:2] for key in (*one, *other)})
    a, b = _matrix(one, rows), _matrix(other, rows)
    ranks = [np.linalg.matrix_rank(made, tol=1e-9) for made in (a, b, np.hstack((a, b)))]
    return bool(min(ranks) == max(ranks))


def _matrix(effects: Effects, rows: list[tuple[str, str]]) -> Array:
    """Effects as columns of unit length, shape (rows, sizes that show)."""
    sizes = sorted({key[2] for key in effects})
    made = np.array([[effects.get((*row, size), 0.0) for size in sizes] for row in rows])
    return np.asarray(made / np.linalg.norm(made, axis=0))
