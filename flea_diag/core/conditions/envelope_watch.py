"""Where a stream of scans lies outside what its calibration has seen.

Beyond the reach of the calibration the variance of a relation's tests grows with the leverage, and
that of all other tests but those of single sensors by the same factor: what two sensors differ by,
and what a prediction neglects, depends on load and place as well. At an end of the travel that few
recordings came to, a residual scatters by its own factor, if that is more.
Where the leverage stays beyond ``ABSTAIN`` times the largest that nominal recordings had (twice
their distance), the tests that rest on the relation say nothing, until the motion has been back
within for ``BACK`` scans.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.leverage import (
    ABSTAIN,
    PLACE,
    CalibrationEnvelope,
    LeverageBasis,
    leverages,
    stretches,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualRows

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OperatingPlace:
    """Where n scans lie.

    ``beyond``: leverage of each residual beyond the reach; ``travel``: its factor at an end of the
    travel. Both of shape (n, residuals), None where no scan has any.
    """

    beyond: Array | None = None
    travel: Array | None = None

    def factor(self, discrepancy: float | Array = 1.0) -> Array | None:
        """How many times each residual scatters as in the middle of what was seen.

        ``discrepancy``, shape (residuals,), is what the leverage counts.
        """
        if self.beyond is None:
            return self.travel
        factor: Array = np.sqrt(1.0 + self.beyond * discrepancy)
        return factor if self.travel is None else np.maximum(factor, self.travel)


class EnvelopeWatch:
    """State of one stream."""

    def __init__(self, known: CalibrationEnvelope, relations: RelationSet, kernel: int) -> None:
        # Before the tests abstain: smoothing makes so many scans of one jerk.
        self._enough, self._back = kernel // 3, 3 * kernel
        self._basis = LeverageBasis(relations)
        rows = {row.relation: row for row in known.relations}
        fitted = [rows.get(name) for name in self._basis.names]
        # A relation without a fit has no leverage, and is never far.
        self._root = np.zeros((self._basis.width, self._basis.width))
        for start, row in zip(self._basis.starts, fitted, strict=True):
            if row is not None:
                block = slice(start, start + len(row.root))
                self._root[block, block] = row.root
        self._reach = np.array([row.reach if row else np.inf for row in fitted])
        self._far = np.array([ABSTAIN * row.most if row else np.inf for row in fitted])
        # Nothing rests on the place alone.
        self._far[[name == PLACE for name in self._basis.names]] = np.inf
        self._known = table = relations.residuals
        self._channel, self._position = known.position, table.channel(known.position)
        self._ranges, self._signals = known.ranges, relations.signals
        self._units = relations.units_of
        self._columns = [table.of_relation(name) for name in self._basis.names]
        alone = {*chain(range(len(table.rows))[table.sensor_columns], *self._columns)}
        self._others = [j for j in range(len(table.rows)) if j not in alone]
        self._travel = known.travel
        if self._travel is not None:
            self._factors = self._travel.table([row.name for row in table.rows])
        self._beyond = [0] * len(fitted)
        self._within = [self._back] * len(fitted)
        self.outside: tuple[int, ...] = ()
        """Relations whose tests abstain, by their place."""
        self.words = ""
        self.turned = False
        """Whether the last scan has changed what abstains."""
        self.place = OperatingPlace()

    def step(self, rows: Array, residuals: ResidualRows) -> int:
        """Take n scans; the first that changes what abstains, or n. Nothing counts from there."""
        count, self.turned = len(rows), False
        position = rows[:, self._position] if self._position >= 0 else np.zeros(count)
        beyond, travel = None, self._at(position)
        psi = self._basis.rows(residuals.signals, position)
        h = leverages(psi, self._root, self._basis.starts)
        # A reading that is missing says nothing of where it is: NaN is beyond nothing.
        if (h > self._reach).any():
            over = np.where(h > self._reach, h - self._reach, 0.0)
            beyond = np.zeros((count, len(self._known.rows)))
            beyond[:, self._others] = over.max(axis=1)[:, None]
            for k, columns in enumerate(self._columns):
                beyond[:, columns] = over[:, k, None]
        self.place = OperatingPlace(beyond, travel)
        far = h > self._far
        if not far.any() and not self.outside and not any(self._beyond):
            return count
        return self._turn(far, rows, residuals)

    def _at(self, position: Array) -> Array | None:
        """Factor of each residual at the ends of the travel; None where no scan is at one."""
        if self._travel is None:
            return None
        places = stretches(position, self._travel.edges)
        return self._factors[places] if (places != 1).any() else None

    def _turn(self, far: npt.NDArray[np.bool_], rows: Array, residuals: ResidualRows) -> int:
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
                self.words = self._said(rows[scan], residuals.signals[scan]) if outside else ""
                self.turned = True
                return scan
        return len(far)

    def _said(self, row: Array, signals: Array) -> str:
        """Which variable is out of its range, and what is not tested."""
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
        names = ", ".join(self._known.rows[j].name for k in self.outside for j in self._columns[k])
        return f"{place} calibrated: {names} and the state observer not tested"

    def leave_out(self, residuals: ResidualRows) -> None:
        """Drop what rests on a relation that is outside, and nothing else."""
        for k in self.outside:
            residuals.values[:, self._columns[k]] = np.nan
        if self.outside:
            residuals.values[:, self._known.innovation_columns] = np.nan
