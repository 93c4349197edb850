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

"""Where a stream of scans lies outside what its calibration has seen.

Beyond the reach of the calibration the variance of a relation's tests grows with the leverage, and
that of all other tests but those of single sensors by the same factor: what two sensors differ by,
and what a prediction neglects, depends on load and place as well. At an end of the travel that few
recordings came to, a residual scatters by its own factor, if that is more. A prediction, and what
takes a temperature from it, scatters in proportion to what supplies its store, beyond the most that
was calibrated: the heat of a load counts for as long as it lasts, and the more the farther the
relation lies out itself.
Where the leverage stays beyond ``ABSTAIN`` times the largest that nominal recordings had (twice
their distance), or the supply beyond twice the most, the tests that rest on it say nothing, until
it has been back within for ``BACK`` scans. Two readings of a speed that are both out of their range
are not held against each other: a fault of one sensor leaves the other within.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.conditions.condition import NAMED
from flea_diag.core.conditions.envelope_loops import glance_of
from flea_diag.core.conditions.lingering import Lingering
from flea_diag.core.flat_state import FlatState
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.leverage import (
    ABSTAIN,
    PLACE,
    CalibrationEnvelope,
    LeverageBasis,
    leverages,
    stretches,
)
from flea_diag.core.residuals.parameters import as_record
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.thermal import CORRECTION_S, Heating

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class OperatingPlace:
    """Where n scans lie.

    ``beyond``: leverage of each residual beyond the reach; ``travel``: its factor at an end of the
    travel. Both of shape (n, residuals), None where no scan has any. ``loads``, shape (n, loads),
    are those of ``leverage.PLACE``; None where no envelope knows any. ``supplied``, shape
    (n, 2 stores), is what ``Heating`` gives.
    """

    beyond: Array | None = None
    travel: Array | None = None
    loads: Array | None = None
    supplied: Array | None = None

    def variance(self) -> Array | None:
        """Variance of residuals divided by ``travel``, in times that inside; None: it is 1."""
        if self.beyond is None:
            return None
        grown: Array = 1.0 + self.beyond
        return grown if self.travel is None else np.maximum(grown / np.square(self.travel), 1.0)

    def leverage(self) -> Array | None:
        """``beyond`` of residuals that are divided by ``travel``."""
        if self.beyond is None or self.travel is None:
            return self.beyond
        return self.beyond / np.square(self.travel)


ANYWHERE = OperatingPlace()
"""Where no limit depends on the place."""


def _warmed_by(store: str, relations: RelationSet) -> list[int]:
    """Columns of a prediction, and of what takes a signal from it: relations and the observer."""
    taken = {signal for signal, name in relations.predicted.items() if name == store}
    names = [row.name for row in relations.relations if taken & set(row.signals)]
    table = relations.residuals
    observed = range(len(table.rows))[table.innovation_columns] if taken else ()
    return [table.column(store), *table.of_relations(names), *observed]


class EnvelopeWatch:
    """State of one stream."""

    def __init__(
        self,
        known: CalibrationEnvelope,
        relations: RelationSet,
        parameters: Any,
        kernel: int,
        period_s: float,
        backend: str = "auto",
    ) -> None:
        # Before the tests abstain: smoothing makes so many scans of one jerk.
        self._enough, self._back = kernel // 3, 3 * kernel
        self._relations, self._basis = relations, LeverageBasis(relations)
        rows = {row.relation: row for row in known.relations}
        fitted = [rows.get(name) for name in self._basis.names]
        self._stores = [(row.name, row.unit) for row in relations.predictions]
        stores = [name for name, _ in self._stores]
        # A relation without a fit has no leverage, and is never far.
        self._root = np.zeros((self._basis.width, self._basis.width))
        for start, row in zip(self._basis.starts, fitted, strict=True):
            if row is not None:
                block = slice(start, start + len(row.root))
                self._root[block, block] = row.root
        reach = [row.reach if row else np.inf for row in fitted]
        # Nothing rests on the place alone.
        far = [ABSTAIN * row.most if row and row.relation != PLACE else np.inf for row in fitted]
        # In proportion to the supply, a leverage of 1 where it is the most that was seen.
        self._reach = np.array([*reach, *(1.0 for _ in stores)])
        self._far = np.array([*far, *(ABSTAIN for _ in stores)])
        self._least = np.minimum(self._reach, self._far)
        self._starts = np.array(self._basis.starts)
        self._loads = self._basis.loads(known.load_metric)
        self._heating = Heating(relations, parameters, period_s, known)
        self._most = self._heating.most
        self._known = table = relations.residuals
        self._channel, self._position = known.position, table.channel(known.position)
        self._ranges, self._signals = known.ranges, relations.signals
        self._units = relations.units_of
        self._columns = [table.of_relation(name) for name in self._basis.names]
        # A prediction rests on what supplies it, wherever that is.
        predicted = map(table.column, stores)
        alone = {*chain(range(len(table.rows))[table.sensor_columns], predicted, *self._columns)}
        self._others = [j for j in range(len(table.rows)) if j not in alone]
        self._columns += [_warmed_by(store, relations) for store in stores]
        self._travel = known.travel
        if self._travel is not None:
            self._factors = self._travel.table([row.name for row in table.rows])
        self._compare(known, relations, kernel)
        # numba knows no empty tuple of results.
        compiled = backends.chosen(backend) == "numba" and bool(stores)
        self._compiled: tuple[Any, ...] = (
            self._known_of(relations, parameters, period_s) if compiled else ()
        )
        self._beyond = [0] * len(self._columns)
        self._within = [self._back] * len(self._columns)
        self.outside: tuple[int, ...] = ()
        """Relations whose tests abstain, then stores, by their place."""
        self.words = ""
        self.turned = False
        """Whether the last scan has changed what abstains."""
        self.place = ANYWHERE

    def _compare(self, known: CalibrationEnvelope, relations: RelationSet, kernel: int) -> None:
        """Which readings of a speed are held against each other, and their ranges."""
        self._speeds = NAMED["faster_than_recorded"].columns(relations)
        one_speed = relations.residuals.of_one_speed
        compared = [row for row in relations.relations if row.name in one_speed]
        read = [s for row in compared for s in row.signals if s in known.ranges]
        self._read = [(relations.signals.index(name), *known.ranges[name]) for name in read]
        self._faster, self._fast = Lingering(kernel), True
        """Whether a speed may have been beyond its range in the last scans."""

    def _known_of(
        self, relations: RelationSet, parameters: Any, period_s: float
    ) -> tuple[Any, ...]:
        """What ``envelope_loops`` takes beside the scans."""
        heats, (which, along) = self._heating, self._basis.columns
        compared = [(low, high) for _, low, high in self._read]
        ends = [*zip(heats.low, heats.high, strict=True), *compared]
        count = len(self._starts)
        numbers = {
            "root": self._root, "far": self._least[:count], "hot": self._least[count:],
            "fade": period_s / CORRECTION_S, "means": np.zeros((3, len(self._most))),
            "most": self._most, "ends": np.array(ends).reshape(-1, 2),
        }  # fmt: skip
        counts = {
            "which": which, "along": along, "starts": self._starts, "supplying": heats.read,
            "read": [k for k, *_ in self._read], "position": self._position,
            "loads": (self._loads.start, self._loads.stop),
        }  # fmt: skip
        return as_record(parameters), FlatState(numbers, counts)

    def _glance(self, signals: Array, rows: Array) -> tuple[bool, Array, Array, Array]:
        """Whether all scans are surely within; their loads, shares of the supply, and heating."""
        count, stores = len(signals), len(self._most)
        loads = np.empty((count, self._loads.stop - self._loads.start))
        share, heating = np.empty((count, stores)), np.empty((count, 2 * stores))
        parameters, tables = self._compiled
        within, self._fast = glance_of(self._relations)(
            parameters, signals, rows, tables.flat, (loads, share, heating)
        )
        return within, loads, share, heating

    def step(self, rows: Array, residuals: ResidualRows) -> int:
        """Take n scans; the first that changes what abstains, or n. Nothing counts from there."""
        count, self.turned = len(rows), False
        travel, within = self._at(rows), False
        if self._compiled:
            within, loads, share, heating = self._glance(residuals.signals, rows)
        else:
            share, heating = self._heating.step(residuals.signals)
        if within and travel is None and not (self.outside or any(self._beyond)):
            self.place = OperatingPlace(loads=loads, supplied=heating)
            return count
        h = np.zeros((count, len(self._least)))
        if not within:
            psi = self._basis.rows(residuals.signals, self._placed(rows))
            loads = np.ascontiguousarray(psi[:, self._loads])
            h[:, : len(self._starts)] = leverages(psi, self._root, self._starts)
            h[:, len(self._starts) :] = np.square(share)
            # A reading that is missing says nothing of where it is: NaN is beyond nothing.
            within = not np.count_nonzero(h > self._least)
        if within and travel is None and not (self.outside or any(self._beyond)):
            self.place = OperatingPlace(loads=loads, supplied=heating)
            return count
        beyond = None if within else self._variance(h)
        self.place = OperatingPlace(beyond, travel, loads, heating)
        far = h > self._far
        if not (np.count_nonzero(far) or self.outside or any(self._beyond)):
            return count
        return self._turn(far, rows, residuals.signals, share)

    def _variance(self, h: Array) -> Array:
        """How much the variance of each residual has grown, shape (n, residuals)."""
        over = np.where(h > self._reach, h - self._reach, 0.0)
        beyond = np.zeros((len(h), len(self._known.rows)))
        relations = len(self._basis.names)
        beyond[:, self._others] = over[:, :relations].max(axis=1)[:, None]
        for k, columns in enumerate(self._columns[:relations]):
            beyond[:, columns] = np.maximum(beyond[:, columns], over[:, k, None])
        # What a prediction is off by shows in proportion to the regressors, wherever they are.
        for k, columns in enumerate(self._columns[relations:], start=relations):
            beyond[:, columns] = (1.0 + beyond[:, columns]) * (1.0 + over[:, k, None]) - 1.0
        return beyond

    def _placed(self, rows: Array) -> Array:
        """Positions, shape (n,)."""
        return rows[:, self._position] if self._position >= 0 else np.zeros(len(rows))

    def _at(self, rows: Array) -> Array | None:
        """Factor of each residual at the ends of the travel; None where no scan is at one."""
        if self._travel is None:
            return None
        low, high = self._travel.edges
        position = self._placed(rows)
        if len(position) == 1 and not (position.item(0) < low or position.item(0) > high):
            return None  # the same without arrays
        places = stretches(position, self._travel.edges)
        return self._factors[places] if (places != 1).any() else None

    def _turn(self, far: Flags, rows: Array, signals: Array, share: Array) -> int:
        """Follow the scans up to the first that changes the state."""
        for scan, flags in enumerate(far.tolist()):
            for k, beyond in enumerate(flags):
                self._beyond[k] = self._beyond[k] + 1 if beyond else 0
                self._within[k] = 0 if beyond else self._within[k] + 1
            outside = tuple(
                k
                for k in range(len(flags))
                if self._beyond[k] >= self._enough
                or (k in self.outside and self._within[k] < self._back)
            )
            if outside != self.outside:
                self.outside = outside
                where = rows[scan], signals[scan], share[scan]
                self.words = self._said(*where) if outside else ""
                self.turned = True
                return scan
        return len(far)

    def _said(self, row: Array, signals: Array, share: Array) -> str:
        """Which variable is out of its range, and what is not tested."""
        first = self.outside[0]
        hot = first - len(self._basis.names)
        place = self._place(row, signals) if hot < 0 else self._heat(hot, share[hot])
        columns = dict.fromkeys(chain.from_iterable(self._columns[k] for k in self.outside))
        observed = range(len(self._known.rows))[self._known.innovation_columns]
        names = [self._known.rows[j].name for j in columns if j not in observed]
        if hot < 0 or not columns.keys().isdisjoint(observed):
            names[-1] += " and the state observer"
        return f"{place} calibrated: {', '.join(names)} not tested"

    def _heat(self, store: int, share: float) -> str:
        name, unit = self._stores[store]
        most = self._most[store]
        return f"{name} is supplied with {share * most:.3g} {unit}/s, up to {most:.3g} {unit}/s was"

    def _place(self, row: Array, signals: Array) -> str:
        """The signal that is farthest out of its range, if any is."""
        values = dict(zip(self._signals, signals.tolist(), strict=True))
        if self._position >= 0:
            values[self._channel] = row[self._position]
        used = {*self._basis.signals, self._channel}
        worst, place = 0.0, "this combination of speed, load and position was not"
        for name in sorted(used & set(self._ranges) & set(values)):
            low, high = self._ranges[name]
            beyond = max(values[name] - high, low - values[name]) / max(high - low, 1e-12)
            if math.isfinite(beyond) and beyond > worst:
                worst, unit = beyond, self._units.get(name, "")
                place = f"{name} is {values[name]:.3g} {unit}, {low:.3g} to {high:.3g} {unit} was"
        return place

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop what rests on a relation that is outside, and nothing else."""
        for k in self.outside:
            residuals.values[:, self._columns[k]] = np.nan
        if self._read and (self._fast or self._faster.lasts):
            # Plain numbers: one scan costs less than one call of numpy.
            read = ((residuals.signals[:, k].tolist(), *ends) for k, *ends in self._read)
            beyond = ([x < low or x > high for x in values] for values, low, high in read)
            void = self._faster.step(list(map(all, zip(*beyond, strict=True))))
            if void is not None:
                residuals.leave_out(void, self._speeds)
        if self.outside and self.outside[0] < len(self._basis.names):
            residuals.values[:, self._known.innovation_columns] = np.nan
