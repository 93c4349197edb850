"""Leverage of operating points on the relations that were fitted to nominal recordings.

A relation r(s; theta) = 0 was fitted where its regressors phi lay. The variance of a prediction
grows with the leverage

    h = psi' (Psi' Psi / n)^-1 psi / p,      psi = (phi, x phi),

whose mean over the recordings is 1: with phi alone where the relation is linear, and with x phi,
x the position, because what a relation neglects (a screw that is worn here and not there) varies
along the travel. phi leaves out the response, the signal that a fault of the plant moves first:
a fault must not look like a place that nobody has seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.collect import collect
from flea_diag.core.symbolic.expression import Expression, Variable, symbols
from flea_diag.core.symbolic.generated import compiled, function_source

Array = npt.NDArray[np.float64]

ABSTAIN = 4.0
"""Leverage, in times ``LeverageFit.most``, beyond which the tests of a relation abstain."""
LEAST_SINGULAR = 1e-2
"""Of a direction in which the recordings hardly vary, against the largest."""


@dataclass(frozen=True)
class LeverageFit(Frozen):
    """Leverage of one relation: h = |psi root|^2.

    ``reach`` is what 99 % of nominal scans stay below, ``most`` what all but spikes do;
    ``discrepancy``, in the unit of the relation, scales what is added to its variance beyond
    ``reach``.
    """

    relation: str
    root: tuple[tuple[float, ...], ...]
    reach: float
    most: float
    discrepancy: float


@dataclass(frozen=True)
class CalibrationEnvelope(Frozen):
    """Where a calibration was made: leverage of each relation, and the range of each signal."""

    position: str
    """Channel of x; empty where no sensor reads a displacement."""
    relations: tuple[LeverageFit, ...]
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class LeverageBasis:
    """psi of every relation with a known response, from the signals of the relations."""

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
        counts = [2 * len(row) for row in rows]
        self.starts = tuple(sum(counts[:k]) for k in range(len(rows)))
        self.width = sum(counts)
        used = dict.fromkeys(s for row in rows for basis in row for s in symbols(basis))
        self.signals = tuple(used)
        """Signals that the regressors are made of."""
        source = function_source("regressors", "phi of each relation.", relations.signals, rows)
        self._regressors = compiled(source)["regressors"] if rows else None

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
            return np.array([[v for row in known for v in (*row, *(x * each for each in row))]])
        psi = np.empty((len(signals), self.width))
        for start, row in zip(self.starts, self._regressors(None, list(signals.T)), strict=True):
            for k, column in enumerate(row):
                psi[:, start + k] = column
                psi[:, start + len(row) + k] = position * column
        return psi


def leverages(psi: Array, root: Array, starts: Sequence[int]) -> Array:
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
