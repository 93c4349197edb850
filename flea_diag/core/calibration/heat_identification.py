"""Supply and exchange of predicted stores, from one slope per recording.

    dx/dt = sum of h q + sum of g (neighbour - x)          for the motor of the FLEA:
    dT/dt = h (i - i0)^2 + (Ta - T) / tau

Noise masks changes within a run, so each run is one row: its slope, the means of what supplies the
store, and the differences from its neighbours. The columns follow from the relations that run
(``prediction``). The covariance follows from the scatter of the rows, each with its own error scale
(White 1980).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.base_parameters import in_base
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.relation_fit import Regression
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.prediction import Prediction
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import (
    Expression,
    Variable,
    derivative,
    evaluate,
    symbols,
)

Array = npt.NDArray[np.float64]

LEAST_RUNS = 4  # assumption: size of a sample
LEAST_SCANS = 500  # assumption: size of a sample
LEAST_EXCHANGE_PER_S = 1e-5  # a day: slower is no exchange
FAR_K = 4.0
"""Single-sample spikes of 10 K and more would bias an ordinary slope."""


class Result(Protocol):
    """Receives the identified parameters and those that cannot be identified."""

    parameters: ActuatorParameters

    def found(self, values: dict[str, float], covariance: Array) -> None:
        """Parameters that the data identify."""
        ...

    def missing(self, names: Sequence[str], reason: str) -> None:
        """Parameters that keep their defaults."""
        ...


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
    result: Result,
) -> None:
    """Identify supply and exchange of every predicted store as far as the recordings allow."""
    balanced = {name for row in relations.relations for name in symbols(row.expression)}
    for store in relations.predictions:
        unknown = [n for n in symbols(store.supply) if n not in {*balanced, *relations.signals}]
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

    def identify(self, runs: Sequence[NominalRun], period_s: float, result: Result) -> None:
        supplied: dict[str, Expression] = {name: Variable(name) for name in self.unknown}
        exchanged = {f"with_{name}": rate for name, rate in self.row.exchange.items()}
        table = [self._row(n, run, period_s, result.parameters) for n, run in enumerate(runs)]
        rows = np.array([row for row in table if row is not None])
        cooling = list(dict.fromkeys(n for rate in exchanged.values() for n in symbols(rate)))
        if len(rows) < LEAST_RUNS:
            channels = " and ".join((self.row.channel, *self.row.exchange))
            words = f"{len(rows)} recordings with {channels}, {LEAST_RUNS} are needed"
            result.missing([*self.unknown, *cooling], words)
            return
        heats, apart, slope = rows[:, : len(supplied)], rows[:, len(supplied) : -1], rows[:, -1]
        fit = _regression(rows[:, :-1], slope, {**supplied, **exchanged})
        x, covariance = _fitted(fit)
        loses = x[len(supplied) :] > LEAST_EXCHANGE_PER_S
        if loses.all() and (x[: len(supplied)] >= 0.0).all():
            result.found(*fit.solved(x, covariance))
            return
        result.missing(cooling, "no cooling within the recordings")
        known = asdict(result.parameters)
        kept = np.array([float(evaluate(rate, known)) for rate in exchanged.values()])
        fit = _regression(heats, slope - apart @ kept, supplied)
        x, covariance = _fitted(fit)
        result.found(*fit.solved(np.maximum(x, 0.0), covariance))

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


def _regression(columns: Array, target: Array, quotients: Mapping[str, Expression]) -> Regression:
    solved = {str(name): e for name, e in in_base(quotients, "predicted stores").items()}
    return Regression(columns, target, tuple(quotients), solved, quotients)


def _fitted(fit: Regression) -> tuple[Array, Array]:
    """Least squares, and its covariance from the row residuals, corrected by n / (n - k)."""
    A, y = fit.columns, fit.target
    x = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0], dtype=np.float64)
    bread = np.linalg.pinv(A.T @ A)
    scores = A * (y - A @ x)[:, None]
    few = len(y) / max(len(y) - A.shape[1], 1)
    covariance: Array = few * bread @ (scores.T @ scores) @ bread
    return x, covariance
