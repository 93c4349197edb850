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

"""Estimates of predicted stores: temperatures, or whatever else is slow.

    x' = supply + sum of exchange * (neighbour - x)        compiled from the graph (``prediction``)

One rule for all. An estimate starts at the mean of the first readings, and is slowly corrected
towards the sensor (``CORRECTION_S``), since the true history of a store before the recording is
unknown; the correction is frozen once a fault has been detected, so that a sensor fault does not
smear into the estimate. What is not known supplies nothing, and is no neighbour.

A supply that is not known may have gone on as it was, or have been the most that was calibrated. By
as much the estimate may be off, and that fades as the store exchanges and is corrected. As long as
it is more than the noise of one reading, the store has no residual: a runaway with its speed beyond
what the encoder holds heats a nut without a fault of its thermometer.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.leverage import CalibrationEnvelope
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import symbols
from flea_diag.errors import ModelError, shown

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.int64]

CORRECTION_S = 15.0
"""Slow against a step or a drift of a sensor, fast against what heat alone can do."""

STRANGE = 0.1
"""Share of the largest supply seen that may come from beyond the ranges of the recordings."""

ESTIMATE, SUM, STARTED, SAMPLES, LAST, UNSURE, FOLLOWS = range(7)
"""Places in the state of a store; the last known |supply|, by what the estimate may be off, and
whether it follows its sensor where others are frozen."""
CHANNEL, RESIDUAL, NEIGHBOURS = 0, 1, 2
"""Places of a store's reading and of its residual in their rows; from the third on, neighbours."""
MOST, NOISE = range(2)
"""Places in the bounds of a store: the largest ``SupplyMean`` of the recordings, unit per second,
and the noise of a reading."""


def advance(
    store: Any, row: Any, supply: float, places: Any, rates: Any, bounds: Any, dt_s: float,
    frozen: bool,
) -> float:  # fmt: skip
    """Take the state of a store on by one scan; measured less estimate.

    NaN until it is started, and while what supplies it is not known. ``row`` are the readings,
    ``rates`` those of the exchange, ``bounds`` what an unknown supply is held against. Any
    sequences of numbers will do; numba compiles these lines, too.
    """
    measured: float = row[places[CHANNEL]]
    if store[STARTED] < store[SAMPLES]:
        if not math.isnan(measured):
            store[SUM] += measured
            store[STARTED] += 1.0
            store[ESTIMATE] = store[SUM] / store[STARTED]
        return math.nan
    known = not math.isnan(supply)
    rate = supply if known else 0.0
    for k in range(len(rates)):
        around = row[places[NEIGHBOURS + k]]
        if not math.isnan(around):
            rate -= rates[k] * (store[ESTIMATE] - around)
    residual: float = measured - store[ESTIMATE]
    store[ESTIMATE] += dt_s * rate
    corrected = not (frozen and store[FOLLOWS] == 0.0) and not math.isnan(residual)
    if corrected:
        store[ESTIMATE] += residual * dt_s / CORRECTION_S
    if known:
        store[LAST] = abs(supply)
        if store[UNSURE] == 0.0:
            return residual
    fades = 1.0 / CORRECTION_S if corrected else 0.0
    for k in range(len(rates)):
        fades += rates[k]
    unknown = 0.0 if known else max(store[LAST], bounds[MOST])
    store[UNSURE] += dt_s * (unknown - fades * store[UNSURE])
    return math.nan if store[UNSURE] > bounds[NOISE] else residual


class PredictedStores(NamedTuple):
    """The predicted stores of one relation set, a row each, as ``bank_loops`` takes them.

    ``states``, shape (stores, 7); ``places``, shape (stores, 2 + neighbours); ``rates``, shape
    (stores, neighbours), of the exchange; ``bounds``, shape (stores, 2).
    """

    states: Array
    places: Places
    rates: Array
    bounds: Array

    @classmethod
    def of(
        cls,
        known: RelationSet,
        channels: Mapping[str, int],
        residuals: Mapping[str, int],
        start_samples: int,
        most: Mapping[str, float] | None = None,
    ) -> PredictedStores:
        """Before the first scan; ``channels`` and ``residuals`` are the places in their rows.

        ``most``: largest ``SupplyMean`` of each store in the recordings; None: not known yet, and
        every store is judged, whatever supplies it.
        """
        around = [channels[name] for name in known.neighbours]
        places = np.empty((len(known.predictions), NEIGHBOURS + len(around)), dtype=np.int64)
        for row, store in zip(places, known.predictions, strict=True):
            if store.channel not in channels or store.name not in residuals:
                raise ModelError(
                    f"prediction {shown(store.name)} of {shown(store.channel)}: no residual of that"
                    f" name is tested, known are {', '.join(residuals)}"
                )
            row[:] = channels[store.channel], residuals[store.name], *around
        states = np.zeros((len(places), 7))
        states[:, ESTIMATE], states[:, SAMPLES] = math.nan, start_samples
        bounds = np.tile([0.0, math.inf], (len(places), 1))
        if most is not None:
            bounds[:, MOST] = [most.get(store.name, 0.0) for store in known.predictions]
            bounds[:, NOISE] = [known.residuals.noise[s.channel] for s in known.predictions]
        return cls(states, places, np.zeros((len(places), len(around))), bounds)

    def adopt(self, known: RelationSet, parameters: Any) -> None:
        """Use the rates of exchange of these parameters."""
        self.rates[:] = known.exchange_rates(parameters)

    def thaw(self, columns: Collection[int]) -> None:
        """Let stores with these residuals follow their sensors, whatever is frozen; no others."""
        self.states[:, FOLLOWS] = np.isin(self.places[:, RESIDUAL], list(columns))

    def follow(
        self, rows: Array, supplies: Sequence[Any], dt_s: float, frozen: bool, values: Array
    ) -> Array:
        """``advance`` of all stores for n scans into the residuals ``values``.

        Returns
        -------
        shape (stores, n)
            Estimates before each scan.
        """
        before = np.empty((len(self.states), len(rows)))
        readings = rows.tolist()
        for k, parts in enumerate(zip(*self, strict=True)):
            store, at, rate, bound = (part.tolist() for part in parts)
            flows = np.broadcast_to(supplies[k], len(rows)).tolist()
            residuals, estimates = [], []
            for row, supply in zip(readings, flows, strict=True):
                estimates.append(store[ESTIMATE])
                residuals.append(advance(store, row, supply, at, rate, bound, dt_s, frozen))
            parts[0][:] = store
            before[k], values[:, at[RESIDUAL]] = estimates, residuals
        return before


class SupplyMean:
    """What supplies each predicted store of a stream, averaged over ``CORRECTION_S``.

    A prediction is as good as its rate, and most of the rate is what supplies the store. A residual
    follows an error of the rate with ``CORRECTION_S``, and so does this mean. What is exchanged is
    left out: healthy units differ by a tenth of it, at 30 K by 0.01 K/s where 0.03 K/s are allowed,
    and a fault of a sensor would be in it.
    """

    def __init__(self, relations: RelationSet, parameters: Any, period_s: float) -> None:
        self._supplies, self._p = relations.functions["supplies"], parameters
        self._share = period_s / CORRECTION_S
        self._means = [0.0] * len(relations.predictions)

    def step(self, signals: Array) -> Array:
        """|Mean| after each of n scans, unit per second, shape (n, stores).

        ``signals`` has shape (n, signals). What is not known supplies nothing.
        """
        count = len(signals)
        if count == 1:
            supplies = self._supplies(self._p, signals[0].tolist())
            flows = zip(self._means, supplies, strict=False)
            self._means = [self._next(m, 0.0 if math.isnan(flow) else flow) for m, flow in flows]
            return np.abs((self._means,))
        means = np.empty((count, len(self._means)))
        supplies = self._supplies(self._p, list(signals.T))
        for store, last in enumerate(self._means):
            flow = np.nan_to_num(np.broadcast_to(supplies[store], count)).tolist()
            means[:, store] = list(accumulate(flow, self._next, initial=last))[1:]
        self._means = means[-1].tolist()
        return np.abs(means)

    def _next(self, mean: float, flow: float) -> float:
        return mean + self._share * (flow - mean)


class Heating:
    """How far what is heated is ahead of the store that is predicted: two regressors a store.

    A winding leads its housing by what flows between them, after a lag that no recording of the
    housing tells. Means of the supply (``SupplyMean``), taken once and twice, span such lags as
    recordings have shown. Heat from beyond their ranges, as that of a current against a stop, is
    none of them: while it lasts, nothing is known.
    """

    def __init__(
        self,
        relations: RelationSet,
        parameters: Any,
        period_s: float,
        envelope: CalibrationEnvelope,
    ) -> None:
        self._share = period_s / CORRECTION_S
        self._supply, self._strange = (
            SupplyMean(relations, parameters, period_s) for _ in range(2)
        )
        self.most = np.array([envelope.supplies.get(s.name, np.inf) for s in relations.predictions])
        """Largest ``SupplyMean`` of each store that was seen, shape (stores,)."""
        self._twice = [0.0] * len(self.most)
        read = {name for store in relations.predictions for name in symbols(store.supply)}
        read &= set(envelope.ranges)
        self.read = [k for k, name in enumerate(relations.signals) if name in read]
        """Signals that supply and have a range, by their places, and these ranges."""
        ranges = [envelope.ranges[relations.signals[k]] for k in self.read]
        self.low, self.high = np.array(ranges).reshape(-1, 2).T

    def step(self, signals: Array) -> tuple[Array, Array]:
        """``SupplyMean`` of n scans in times the most seen, shape (n, stores), and what follows it.

        That has shape (n, 2 stores): the same, then the mean of it; NaN where it is not known.
        """
        share = self._supply.step(signals) / self.most
        columns = zip(self._twice, share.T.tolist(), strict=True)
        twice = [list(accumulate(mean, self._next, initial=last))[1:] for last, mean in columns]
        self._twice = [column[-1] for column in twice]
        read = signals[:, self.read]
        beyond = ((read < self.low) | (read > self.high)).any(axis=1, keepdims=True)
        strange = self._strange.step(np.where(beyond, signals, np.nan)) / self.most
        once = np.where(strange > STRANGE, np.nan, share)
        return share, np.column_stack((once, *map(np.array, twice)))

    def _next(self, twice: float, mean: float) -> float:
        return twice + self._share * (mean - twice)
