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

"""Leverage of operating points on the relations that were fitted to nominal recordings.

A relation r(s; theta) = 0 was fitted where its regressors phi lay. The variance of a prediction
grows with the leverage

    h = psi' (Psi' Psi / n)^-1 psi / p,

whose mean over the recordings is 1. psi is phi for the motor circuit, and (phi, x phi) for the
balance that holds the friction, x the position: what that one neglects (a screw that is worn here
and not there) varies along the travel. phi leaves out the response, the signal that a fault of the
plant moves first: a fault must not look like a place that nobody has seen.

A recording that comes farther than the others shows what is off at its place and nowhere else. So
the travel has three stretches: the middle, to which several recordings came, and an end on either
side of it. At an end a residual is divided by a factor of its own before it is tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.measured_graph import channel_of
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import ONE, Expression, Variable, symbols
from flea_diag.core.symbolic.generated import compiled, function_source
from flea_diag.fields.values import Positive, within

Array = npt.NDArray[np.float64]

ABSTAIN = 4.0
"""Leverage, in times ``LeverageFit.most``, beyond which the tests of a relation abstain."""
PLACE = "place"
"""Load and position: what sensors that read one quantity at two places differ by."""
Factor = Annotated[float, within(1.0, 1e6)]
LEAST_SINGULAR = 1e-2
"""Of a direction in which the recordings hardly vary, against the largest."""


@dataclass(frozen=True)
class LeverageFit(Frozen):
    """Leverage of one relation: h = |psi root|^2.

    ``reach`` is what 99 % of nominal scans stay below, ``most`` what all but spikes do.
    """

    relation: str
    root: tuple[tuple[float, ...], ...]
    reach: Positive
    most: Positive


@dataclass(frozen=True)
class TravelFactors(Frozen):
    """Edges of the middle, and the factors of each residual below, in and above it."""

    edges: tuple[float, float]
    factors: Mapping[str, tuple[Factor, Factor, Factor]]

    def table(self, names: Sequence[str]) -> Array:
        """Factors of these residuals, shape (3, residuals); 1 where none is known."""
        return np.array([self.factors.get(name, (1.0, 1.0, 1.0)) for name in names]).T


@dataclass(frozen=True)
class CalibrationEnvelope(Frozen):
    """Where a calibration was made: leverage of each relation, and the range of each signal."""

    position: str
    """Channel of x; empty where no sensor reads a displacement."""
    relations: tuple[LeverageFit, ...]
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    travel: TravelFactors | None = None
    """What residuals are at the ends of the travel; None in an older file, or where no more."""
    supplies: Mapping[str, Positive] = field(default_factory=dict)
    """Largest ``SupplyMean`` of each predicted store, unit per second; empty in an older file."""

    @property
    def load_metric(self) -> Array:
        """Root of the leverage of a change of load, shape (loads, loads): |load root|^2.

        It is that of (1, loads), which psi = (1, loads, x, x loads) of ``PLACE`` holds. Empty where
        no recording shows any.
        """
        place = next((row for row in self.relations if row.relation == PLACE), None)
        if place is None:
            return np.empty((0, 0))
        root, count = np.array(place.root), len(place.root) // 2
        moments = np.linalg.inv(root @ root.T)[:count, :count] / len(root)
        scatter = moments[1:, 1:] - np.outer(moments[0, 1:], moments[0, 1:]) / moments[0, 0]
        return np.asarray(np.linalg.cholesky(np.linalg.inv(scatter) / count), dtype=np.float64)


class LeverageBasis:
    """psi of every relation with a known response, and of ``PLACE``, from the signals."""

    def __init__(self, relations: RelationSet) -> None:
        left_out, rows_of = set(relations.predicted), relations.residuals
        responses = {rows_of.friction: rows_of.current, rows_of.circuit: rows_of.voltage}
        self.names: dict[str, tuple[str, ...]] = {}
        rows: list[tuple[Expression, ...]] = []
        for name in relations.differing:
            row = relations.named[name]
            bases = collect(row.expression, row.signals)
            known = [b for b in bases if not left_out & set(symbols(b))]
            known = [b for b in known if b != Variable(responses.get(name, ""))]
            if name in responses:
                self.names[name] = tuple(map(str, known))
                rows.append(tuple(known))
        loads = [s for s in self._loads(relations, rows) if s not in left_out]
        self.names[PLACE] = ("1", *loads)
        rows.append((ONE, *map(Variable, loads)))
        self._along = [name != rows_of.circuit for name in self.names]
        counts = [len(row) * (1 + along) for row, along in zip(rows, self._along, strict=True)]
        self.starts = tuple(sum(counts[:k]) for k in range(len(rows)))
        self.width = sum(counts)
        self.read = {
            name: tuple(dict.fromkeys(s for basis in row for s in symbols(basis)))
            for name, row in zip(self.names, rows, strict=True)
        }
        """Signals that the regressors of each relation are made of."""
        self.signals = tuple(dict.fromkeys(s for read in self.read.values() for s in read))
        """Those of all."""
        source = function_source("regressors", "phi of each relation.", relations.signals, rows)
        self._regressors = compiled(source)["regressors"] if rows else None
        flat = [[entry for row in rows for entry in row]]
        source = function_source("flat", "phi of all relations in a row.", relations.signals, flat)
        self.flat = compiled(source)["flat"]
        sizes = [(len(row), along) for row, along in zip(rows, self._along, strict=True)]
        firsts = [sum(size for size, _ in sizes[:k]) for k in range(len(sizes))]
        pieces = [
            (first + k, by_place)
            for first, (size, along) in zip(firsts, sizes, strict=True)
            for by_place in (False, True)[: 1 + along]
            for k in range(size)
        ]
        self.columns = [place for place, _ in pieces], [by_place for _, by_place in pieces]
        """Of each column its place in ``flat``, and whether it is that times the position."""

    def _loads(
        self, relations: RelationSet, rows: Sequence[tuple[Expression, ...]]
    ) -> tuple[str, ...]:
        """Signals of the regressors that are a load: no motion, no current, no shape."""
        known = relations.residuals
        other = {*relations.shapes, *known.motion, known.current, known.voltage}
        read = dict.fromkeys(s for row in rows for basis in row for s in symbols(basis))
        return tuple(s for s in read if s not in other and not channel_of(s)[1])

    def loads(self, metric: Array) -> slice:
        """Columns of the loads in ``PLACE``: as many as the metric of the recordings knows."""
        first = self.starts[list(self.names).index(PLACE)] + 1
        return slice(first, first + len(metric))

    def rows(self, signals: Array, position: Array) -> Array:
        """Psi of all relations side by side, shape (n, columns).

        ``signals`` has shape (n, signals), ``position`` (n,). Those of relation k are the columns
        from ``starts[k]`` on.
        """
        if self._regressors is None:
            return np.empty((len(signals), 0))
        if len(signals) == 1:
            x = float(position[0])
            known = self._regressors(None, signals[0].tolist())
            parts = zip(known, self._along, strict=True)
            return np.array([[v for row, a in parts for v in (*row, *(x * u for u in row * a))]])
        psi = np.empty((len(signals), self.width))
        known = self._regressors(None, list(signals.T))
        for start, row, along in zip(self.starts, known, self._along, strict=True):
            for k, column in enumerate(row):
                psi[:, start + k] = column
                if along:
                    psi[:, start + len(row) + k] = position * column
        return psi


def stretches(position: Array, edges: tuple[float, float]) -> npt.NDArray[np.int64]:
    """Stretch of each position: 0, 1, 2; a reading that is missing lies in the middle."""
    low, high = edges
    return 1 - (position < low) + (position > high)


def leverages(psi: Array, root: Array, starts: Sequence[int] | npt.NDArray[np.int64]) -> Array:
    """H of each relation, shape (n, relations): the same bits, however many rows come at once.

    ``root`` has the root of each relation as a block on its diagonal.
    """
    seen = np.matmul(psi[:, None, :], root)[:, 0, :]
    return np.asarray(np.add.reduceat(seen * seen, starts, axis=1))


def leverage_root(psi: Array) -> Array:
    """Root of the inverse information of these rows, so that their mean leverage is 1."""
    scale = np.sqrt(np.square(psi).mean(axis=0))
    scale[scale == 0.0] = 1.0
    _, singular, turned = np.linalg.svd(psi / scale, full_matrices=False)
    singular = np.maximum(singular, LEAST_SINGULAR * singular[0])
    root: Array = turned.T / singular * np.sqrt(len(psi) / psi.shape[1]) / scale[:, None]
    return root
