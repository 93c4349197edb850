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

"""Supply and exchange of predicted stores, from one slope per recording.

    dx/dt = sum of h q + sum of g (neighbour - x)          for the motor of the FLEA:
    dT/dt = h (i - i0)^2 + (Ta - T) / tau

Noise masks changes within a run, so each run is one row: its slope, the means of what supplies the
store, and the differences from its neighbours. The columns follow from the relations that run
(``prediction``). The covariance follows from the scatter of the rows, each with its own error scale
(White 1980).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.identified import Identified
from flea_diag.core.calibration.relation_fit import Regression, of_quotients, parted
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.prediction import Prediction
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import (
    Constant,
    Expression,
    Variable,
    derivative,
    evaluate,
    substitute,
    symbols,
)

Array = npt.NDArray[np.float64]

LEAST_RUNS = 4  # assumption: size of a sample
LEAST_SCANS = 500  # assumption: size of a sample
LEAST_EXCHANGE_PER_S = 1e-5  # a day: slower is no exchange
WITH = "with_"
"""How the name of a column of exchange begins; the channel follows."""
ALIKE = "no recording of this store tells it from the others"
FAR_K = 4.0
"""Single-sample spikes of 10 K and more would bias an ordinary slope."""


@dataclass(frozen=True)
class NominalSignals:
    """Smoothed signals of all runs by name, shape (n,), and the run of each row."""

    columns: Mapping[str, Array]
    run: npt.NDArray[np.int64]

    def of_run(self, number: int) -> dict[str, Any]:
        """Signals of one run."""
        return {name: column[self.run == number] for name, column in self.columns.items()}


def identify(
    runs: Sequence[NominalRun],
    period_s: float,
    relations: RelationSet,
    signals: NominalSignals,
    result: Identified,
) -> None:
    """Identify supply and exchange of every predicted store as far as the recordings allow."""
    balanced = {name for row in relations.relations for name in symbols(row.expression)}
    for store in relations.predictions:
        unknown: list[str] = []
        for name in symbols(store.supply):
            slope = set(symbols(derivative(store.supply, name)))
            if name not in {*balanced, *relations.signals}:
                unknown += [] if slope & set(unknown) else [name]
                result.missing([name] if slope & set(unknown) else [], ALIKE)
        if unknown or store.exchange:
            _Store(store, tuple(unknown), signals, relations.residuals.index).identify(
                runs, period_s, result
            )


@dataclass(frozen=True)
class _Store:
    """One predicted store, and the parameters ``unknown`` of its supply."""

    row: Prediction
    unknown: tuple[str, ...]
    signals: NominalSignals
    index: Mapping[str, int]

    def identify(self, runs: Sequence[NominalRun], period_s: float, result: Identified) -> None:
        """Identify what this store alone fixes: the parameters of others are known by then."""
        names = dict.fromkeys(n for rate in self.row.exchange.values() for n in symbols(rate))
        cooling = [name for name in names if name not in result.sigmas]
        table = [self._row(n, run, period_s, result.parameters) for n, run in enumerate(runs)]
        rows = np.array([row for row in table if row is not None])
        if len(rows) < LEAST_RUNS:
            channels = " and ".join((self.row.channel, *self.row.exchange))
            words = f"{len(rows)} recordings with {channels}, {LEAST_RUNS} are needed"
            result.missing([*self.unknown, *cooling], words)
            return
        fit = self._regression(rows, cooling, result)
        if fit is not None and self._taken(fit, result):
            return
        result.missing(cooling, "no cooling within the recordings")
        fit = self._regression(rows, (), result)
        if fit is not None:
            x, covariance = _fitted(fit)
            result.found(*fit.solved(np.maximum(x, 0.0), covariance))

    def _taken(self, fit: Regression, result: Identified) -> bool:
        """Whether a fit is one of a store that is heated and cools down; it is then stored."""
        x, covariance = _fitted(fit)
        values, errors = fit.solved(x, covariance)
        cools = [value > LEAST_EXCHANGE_PER_S for value in x[self._heating(fit) :]]
        if not (all(cools) and (x >= 0.0).all() and all(v >= 0.0 for v in values.values())):
            return False
        result.found(values, errors)
        return True

    def _heating(self, fit: Regression) -> int:
        """How many columns are of the supply: they come first."""
        return sum(not name.startswith(WITH) for name in fit.names)

    def _regression(
        self, rows: Array, cooling: Collection[str], result: Identified
    ) -> Regression | None:
        """Regression of the slope on supply and exchange; None where nothing is left to fit.

        What no recording of this store could fix keeps its value.
        """
        known, left = asdict(result.parameters), [*self.unknown, *cooling]
        while left:
            given = {n: Constant(v) for n, v in known.items() if n not in left}
            columns, target = [], rows[:, -1].copy()
            quotients: dict[str, Expression] = {}
            forms = {n: Variable(n) for n in self.unknown} | {
                WITH + name: rate for name, rate in self.row.exchange.items()
            }
            for place, (name, form) in enumerate(forms.items()):
                number, quotient = parted(substitute(form, given))
                if symbols(quotient):
                    quotients[name] = quotient
                    columns.append(number * rows[:, place])
                else:
                    target -= float(evaluate(form, known)) * rows[:, place]
            fit = of_quotients(np.stack(columns, axis=1), target, quotients, known)
            if not fit.unscaled:
                return fit
            result.missing(fit.unscaled, ALIKE)
            left = [name for name in left if name not in fit.unscaled]
        return None

    def _row(
        self, number: int, run: NominalRun, period_s: float, p: ActuatorParameters
    ) -> tuple[float, ...] | None:
        """Mean of each supply, differences from the neighbours, and slope of one recording."""
        measured = run.rows[:, self.index[self.row.channel]]
        middle = np.nanmedian(measured) if np.isfinite(measured).any() else np.nan
        use = np.isfinite(measured) & (np.abs(measured - middle) < FAR_K)
        around = [run.rows[:, self.index[name]] for name in self.row.exchange]
        if use.sum() < LEAST_SCANS or not all(np.isfinite(each).any() for each in around):
            return None
        time_s = np.arange(len(run.rows)) * period_s
        slope = float(np.polyfit(time_s[use], measured[use], 1)[0])
        # Smoothed, as in the residual bank: PWM ripple heats too, but equally in both places.
        known = {**asdict(p), **self.signals.of_run(number)}
        sources = [evaluate(derivative(self.row.supply, name), known) for name in self.unknown]
        means = [float(np.mean(source[np.isfinite(source)])) for source in sources]
        return (*means, *(float(np.nanmedian(each) - middle) for each in around), slope)


def _fitted(fit: Regression) -> tuple[Array, Array]:
    """Least squares, and its covariance from the row residuals, corrected by n / (n - k)."""
    A, y = fit.columns, fit.target
    x = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0], dtype=np.float64)
    bread = np.linalg.pinv(A.T @ A)
    scores = A * (y - A @ x)[:, None]
    few = len(y) / max(len(y) - A.shape[1], 1)
    covariance: Array = few * bread @ (scores.T @ scores) @ bread
    return x, covariance
