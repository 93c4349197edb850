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

"""A glance at where scans lie, compiled: most lie well within what was calibrated.

Sums of a leverage run in another order than in ``leverages``, so it is only told whether every one
is surely below its limit; loads and heating are the same bits as in numpy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.flat_state import FLAT, Flat, counts_of, numbers_of
from flea_diag.core.residuals.leverage import LeverageBasis
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import STRANGE

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SURELY = 1.0 - 1e-9
"""Share of a limit below which no order of a sum makes it exceed the limit."""


@lru_cache(maxsize=8)
def glance_of(known: RelationSet) -> Callable[..., tuple[bool, bool]]:
    """``envelope_loops`` with the functions of this set, compiled."""
    regressors, supplies = LeverageBasis(known).flat, known.functions["supplies"]
    loop = backends.bound(envelope_loops, regressors=regressors, supplies=supplies)
    made: Callable[..., tuple[bool, bool]] = backends.exact(loop, regressors, supplies, *FLAT)
    return made


def _unbound(p: Any, x: Array) -> Any:
    """In place of a function that only a relation set has: see ``glance_of``."""
    raise AssertionError("the loop runs with the functions of a relation set")


regressors = supplies = _unbound


TABLES = (
    ROOT,
    FAR,
    HOT,
    FADE,
    MEANS,
    MOST,
    ENDS,
    WHICH,
    ALONG,
    STARTS,
    SUPPLYING,
    READ,
    AT,
    LOADS,
) = range(14)
"""Root of the leverages; limits of these and of the stores; share of a scan, the means (3, stores)
of ``Heating``, and the most that was seen; ends of the signals that supply and of those that
compared speeds are read by. Then the regressor of each column of psi, whether it is times the
position, and where each relation begins; these signals; the channel of the position, -1 without
one, and which columns of psi are loads."""


def envelope_loops(
    parameters: npt.NDArray[np.void], signals: Array, rows: Array, tables: Flat,
    told: tuple[Array, Array, Array],
) -> tuple[bool, bool]:  # fmt: skip
    """Scan after scan; whether all are surely within, and whether any speed may be beyond.

    ``told`` is to be filled: loads, shares of the supply, and what ``Heating`` gives.
    """
    root, ends = numbers_of(tables, ROOT), numbers_of(tables, ENDS)
    far, hot = numbers_of(tables, FAR)[0], numbers_of(tables, HOT)[0]
    fade, means = numbers_of(tables, FADE)[0, 0], numbers_of(tables, MEANS)
    most, which = numbers_of(tables, MOST)[0], counts_of(tables, WHICH)[0]
    along, starts = counts_of(tables, ALONG)[0], counts_of(tables, STARTS)[0]
    supplying, read = counts_of(tables, SUPPLYING)[0], counts_of(tables, READ)[0]
    at, first_load = counts_of(tables, AT)[0, 0], counts_of(tables, LOADS)[0, 0]
    loads, shares, heat = told
    stores, width = len(most), len(which)
    within, fast = True, False
    psi = np.empty(width)
    for i in range(len(signals)):
        x = signals[i]
        phi = regressors(parameters[0], x)[0]
        for k in range(width):
            position = rows[i, at] if at >= 0 else 0.0
            psi[k] = position * phi[which[k]] if along[k] else phi[which[k]]
        for k in range(loads.shape[1]):
            loads[i, k] = psi[first_load + k]
        for r in range(len(starts)):
            end = starts[r + 1] if r + 1 < len(starts) else width
            leverage = 0.0
            for b in range(starts[r], end):
                seen = 0.0
                for a in range(starts[r], end):
                    seen += psi[a] * root[a, b]
                leverage += seen * seen
            within &= not leverage > SURELY * far[r]
        beyond = False
        for k in range(len(supplying)):
            beyond |= x[supplying[k]] < ends[k, 0] or x[supplying[k]] > ends[k, 1]
        flows = supplies(parameters[0], x)
        for s in range(stores):
            flow = 0.0 if math.isnan(flows[s]) else flows[s]
            means[0, s] += fade * (flow - means[0, s])
            shares[i, s] = abs(means[0, s]) / most[s]
            means[1, s] += fade * (shares[i, s] - means[1, s])
            means[2, s] += fade * ((flow if beyond else 0.0) - means[2, s])
            strange = abs(means[2, s]) / most[s] > STRANGE
            heat[i, s], heat[i, stores + s] = math.nan if strange else shares[i, s], means[1, s]
            within &= not shares[i, s] * shares[i, s] > hot[s]
        every = len(read) > 0
        for k in range(len(read)):
            low, high = ends[len(supplying) + k, 0], ends[len(supplying) + k, 1]
            every &= x[read[k]] < low or x[read[k]] > high
        fast |= every
    return within, fast
