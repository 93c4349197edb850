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

"""What a calibration has identified so far, and the regressions by which it goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from flea_diag.core.calibration.calibration import CovarianceBlock
from flea_diag.core.calibration.relation_fit import Regression, regression
from flea_diag.core.calibration.robust_regression import fitted_by_fold, robust_fit
from flea_diag.core.calibration.smoothed_columns import Array, Flags, Smoothed
from flea_diag.core.residuals.parameters import ZEROS, ActuatorParameters, further_of
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import symbols

NOT_NEGATIVE = (
    "coulomb_friction_n",
    "viscous_friction_n_s_per_m",
    "reflected_mass_kg",
    "load_friction_ratio",
)


@dataclass
class Identified:
    """Parameters identified so far, their standard errors, and those not identified."""

    parameters: ActuatorParameters
    sigmas: dict[str, float] = field(default_factory=dict)
    covariance: list[CovarianceBlock] = field(default_factory=list)
    not_identified: dict[str, str] = field(default_factory=dict)
    voltage_limit_v: float = 10.0
    without: list[dict[str, float]] = field(default_factory=list)
    """Of each recording the parameters fitted without it and those left out with it."""
    folds: list[dict[str, tuple[float, float]]] = field(default_factory=list)
    """Of each unit, or recording, its own parameters and their standard errors."""

    def judging(self, recording: int) -> Identified:
        """The same with the parameters that a recording is judged by."""
        values = self.without[recording] if self.without else {}
        return replace(self, parameters=replace(self.parameters, **values))

    def found(self, values: Mapping[str, float], covariance: Array) -> None:
        """Store identified parameters, fitted together with this covariance."""
        self.parameters = replace(self.parameters, **values)
        sigmas = np.sqrt(np.diag(covariance)).tolist()
        self.sigmas.update(zip(values, sigmas, strict=True))
        rows = tuple(map(tuple, np.asarray(covariance).tolist()))
        self.covariance.append(CovarianceBlock(tuple(values), rows))

    def missing(self, names: Sequence[str], reason: str) -> None:
        """Record parameters that keep their defaults."""
        self.not_identified.update(dict.fromkeys(names, reason))


@dataclass(frozen=True)
class RelationFits:
    """What the regressions of one calibration share; ``signals``: columns by name, shape (n,)."""

    data: Smoothed
    relations: RelationSet
    signals: Mapping[str, Array]
    result: Identified

    def regression(
        self, name: str, regressand: str, unknown: Sequence[str], use: Flags
    ) -> Regression | None:
        """Regression of one relation on the rows that it can be formed in; None if in none.

        Parameters that these rows do not fix keep their defaults; of those that act alike zeros of
        sensors do.
        """
        relation = self.relations.named.get(name)
        if relation is None or not set(unknown) & set(symbols(relation.expression)):
            return None
        if regressand not in relation.signals:
            return None
        rows = np.array([np.isfinite(self.signals[signal]) for signal in relation.signals])
        use &= rows.all(axis=0)
        if name in self.data.void:
            use &= ~self.data.void[name]
        if not use.any():
            return None
        known = {k: v for k, v in asdict(self.result.parameters).items() if k not in unknown}
        values = asdict(self.result.parameters)
        while set(symbols(relation.expression)) - {*relation.signals, *known}:
            made = regression(relation, known, regressand, self.signals, use, values, ZEROS)
            loose = made.not_fixed()
            if not loose:
                return made
            self.result.missing(loose, "these recordings do not fix it apart from the others")
            known |= {name: values[name] for name in loose}
        return None

    def further(self, name: str) -> tuple[str, ...]:
        """Parameters of a relation that only this description names, not yet fitted."""
        known = self.relations.named.get(name)
        used = symbols(known.expression) if known else ()
        fitted = self.result.sigmas
        own = further_of(self.result.parameters)
        return tuple(n for n in used if n in own and n not in fitted)

    def take(self, made: Regression, use: Flags, start: Array | None = None) -> tuple[Array, Array]:
        """Solve a regression and store what it finds, with and without each recording.

        Returns the solution of its columns, and the weights of its rows.
        """
        x, covariance, weight = robust_fit(made.columns, made.target, self.data.run[use], start)
        self.result.found(*made.solved(x, covariance))
        self.leave_out(made, weight, use)
        return x, weight

    def leave_out(self, made: Regression, weight: Array, use: Flags) -> None:
        """Store what a fit finds without each recording; nothing where there is but one fold."""
        data, result = self.data, self.result
        folds = int(data.fold.max()) + 1
        if folds < 2:
            return
        fold = data.fold[data.run[use]]
        fits = fitted_by_fold(made.columns, made.target, weight, fold, folds, data.kernel)
        no_error = np.zeros((len(made.names),) * 2)
        values = [possible(made.solved(x, no_error)[0]) for x in fits.without]
        for recording, number in enumerate(data.fold.tolist()):
            result.without[recording].update(values[number])
        result.folds = result.folds or [{} for _ in range(folds)]
        for own, x, covariance in zip(result.folds, fits.alone, fits.covariance, strict=True):
            if np.isfinite(covariance).all():
                found, errors = made.solved(x, covariance)
                sigmas = np.sqrt(np.diag(errors)).tolist()
                own.update({n: (found[n], sigma) for n, sigma in zip(found, sigmas, strict=True)})


def possible(values: dict[str, float]) -> dict[str, float]:
    """Parameters that cannot be negative, at least 0."""
    return values | {name: max(values[name], 0.0) for name in NOT_NEGATIVE if name in values}
