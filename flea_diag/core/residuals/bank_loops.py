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

"""``residual_bank.ResidualBank`` as a loop, for numba to compile: the same bits as in Python.

``relations``, ``spreads`` and ``drag`` are those of a ``RelationSet``: ``bank_of`` binds them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.residuals.measured_graph import channel_of
from flea_diag.core.residuals.relation_set import DIRECTION, RelationSet
from flea_diag.core.residuals.residual import STALL
from flea_diag.core.residuals.residual_rows import Parity
from flea_diag.core.residuals.thermal import ESTIMATE, RESIDUAL, Places, advance
from flea_diag.core.symbolic.expression import symbols

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Rows = tuple[tuple[int, int, int], ...]


class SignalLayout(NamedTuple):
    """Where the functions of a relation set find their signals, and where their values go.

    ``places``: order of derivative and channel of each signal, -1 for what is no channel;
    ``position`` and ``encoder``: channels whose slope, or value, is the speed, -1 without one;
    an encoder that the direction is not by tells no motion of the relation that holds friction.
    ``winding`` and ``direction``: indices of these two signals, -1 if no relation has them.
    ``values``: parity row, its relation, whether it is normalised; ``spreads``: row of the
    spreads, its relation among those that differ, the same.
    """

    places: tuple[tuple[int, int], ...]
    position: int
    encoder: int
    winding: int
    direction: int
    values: Rows
    spreads: Rows


def layout(known: RelationSet) -> SignalLayout:
    """Of one set of relations."""
    rows, index = known.residuals.parities, known.residuals.index
    orders = [channel_of(name) for name in known.signals]
    places = [(order, index[name]) if name in index else (-1, -1) for name, order in orders]
    winding = next(iter(known.predicted), "")
    return SignalLayout(
        tuple(places),
        known.residuals.channel(known.residuals.position),
        known.residuals.channel(_encoder(known)),
        known.signals.index(winding) if winding in known.signals else -1,
        known.signals.index(DIRECTION) if DIRECTION in known.signals else -1,
        _rows(rows, known.names),
        _rows([row for row in rows if row.differs], known.differing),
    )


def _encoder(known: RelationSet) -> str:
    """Encoder that the direction is by; empty: it is by the slope of the position."""
    encoder, way = known.residuals.encoder, known.shapes.get(DIRECTION)
    return encoder if way is None or encoder in symbols(way) else ""


def winding_of(known: RelationSet) -> tuple[int, float]:
    """Predicted store that sets the winding's temperature, -1 if none does; the cold value.

    No part of the layout: stands that differ in nothing else share what is compiled.
    """
    name = next(iter(known.predicted), "")
    stores = [row.name for row in known.predictions]
    by = known.predicted.get(name, "")
    return stores.index(by) if by in stores else -1, known.reference.get(name, math.nan)


def _rows(rows: Sequence[Parity], known: Sequence[str]) -> Rows:
    """Place, relation and normalisation of those rows whose relation is known."""
    return tuple(
        (place, known.index(row.relation), int(row.normalised))
        for place, row in enumerate(rows)
        if row.relation in known
    )


@lru_cache(maxsize=8)
def bank_of(known: RelationSet) -> Callable[..., int]:
    """``bank_loops`` with the functions and the layout of this set, compiled."""
    made, laid = known.functions, layout(known)
    parity = backends.bound(
        parity_loops, relations=made["relations"], spreads=made["spreads"], LAYOUT=laid
    )
    loop = backends.bound(bank_loops, parity_loops=parity, drag=made["drag"], LAYOUT=laid)
    loop = backends.bound(loop, supplies=made["supplies"])
    generated = tuple(made[name] for name in ("relations", "spreads", "drag", "supplies"))
    parts = (*generated, parity, predict_loops, advance)
    compiled: Callable[..., int] = backends.exact(loop, *parts)
    return compiled


def _unbound(p: Any, x: Array) -> Any:
    """In place of a function that only a relation set has: see ``bank_of``."""
    raise AssertionError("the loops run with the functions of a relation set")


relations = spreads = drag = supplies = _unbound
LAYOUT = SignalLayout((), -1, -1, -1, -1, (), ())


def parity_loops(p: Any, x: Array, direction: float, values: Array, spread: Array) -> None:
    """``ResidualBank._parities`` of one scan."""
    sign = math.copysign(1.0, direction)
    formed, apart = relations(p, x), spreads(p, x)
    for k in range(len(LAYOUT.values)):
        place, row, normalised = LAYOUT.values[k]
        values[place] = sign * formed[row] if normalised else formed[row]
    for k in range(len(LAYOUT.spreads)):
        place, row, normalised = LAYOUT.spreads[k]
        factor = sign if normalised else 1.0
        for u in range(spread.shape[1]):
            spread[place, u] = factor * apart[row][u]


def predict_loops(
    stores: tuple[Array, Places, Array, Array], winding: tuple[int, float], row: Array, flows: Any,
    dt_s: float, frozen: bool, values: Array,
) -> float:  # fmt: skip
    """``PredictedStores.follow`` of one scan; the winding's temperature before it."""
    (states, places, rates, bounds), (store, warm) = stores, winding
    if store >= 0 and not math.isnan(states[store, ESTIMATE]):
        warm = states[store, ESTIMATE]
    for k in range(len(states)):
        at = places[k]
        state, bound = states[k], bounds[k]
        values[at[RESIDUAL]] = advance(state, row, flows[k], at, rates[k], bound, dt_s, frozen)
    return warm


def bank_loops(
    rows: Array, smooth: Array, ways: Array, shapes: Array, parameters: npt.NDArray[np.void],
    stores: tuple[Array, Places, Array, Array], winding: tuple[int, float],
    limits: tuple[float, int, float],
    still: int, frozen: bool, told: tuple[Array, Array, Array, Array, Flags],
) -> int:  # fmt: skip
    """Scan after scan; returns for how many scans it has stood still.

    ``ways`` are the smooth signs of the speed, ``shapes``, shape (shapes, n), the values of all,
    ``limits`` the speed above which it moves, scans of a standstill, and the period. ``told`` is to
    be filled: values, spread, signals, speed and direction, moving.
    """
    p, (moving_m_s, rest, dt_s) = parameters[0], limits
    values, spread, signals, motion, moving = told
    places = LAYOUT.places
    measured = len(places) - len(shapes)
    x = np.empty(len(places))
    for i in range(len(rows)):
        value, first = smooth[i, 0], smooth[i, 1]
        for k in range(measured):
            order, channel = places[k]
            if order >= 0:
                x[k] = smooth[i, order, channel]
        for k in range(len(shapes)):
            x[measured + k] = shapes[k, i]
        rate = first[LAYOUT.position] if LAYOUT.position >= 0 else math.nan
        speed = rate
        if LAYOUT.encoder >= 0 and p.encoder_m_per_rad != 0.0:
            speed = value[LAYOUT.encoder] * p.encoder_m_per_rad
        moves = abs(speed) > moving_m_s or abs(rate) > moving_m_s
        still = still + 1 if not moves and abs(speed) <= moving_m_s else 0
        push, dry = drag(p, x)
        stalled = still > rest and abs(push) > STALL * dry
        moving[i] = moves or stalled
        way = math.copysign(1.0, push) if stalled else ways[i]
        if LAYOUT.direction >= 0:
            x[LAYOUT.direction] = way
        flows = supplies(p, x)
        degc = predict_loops(stores, winding, rows[i], flows, dt_s, frozen, values[i])
        if LAYOUT.winding >= 0:
            x[LAYOUT.winding] = degc
        motion[i, 0], motion[i, 1] = speed, way
        for k in range(len(x)):
            signals[i, k] = x[k]
        parity_loops(p, x, way, values[i], spread[i])
    return still
