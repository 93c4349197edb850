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

"""Learns from nominal recordings the observer's noise and the unit variability of innovations.

The effect of unit variability on the innovations has no closed form. It is measured by running
nominal recordings with each parameter offset by its tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import starmap

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration import noise_identification
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.noise_identification import PIECES, SETTLE_SCANS
from flea_diag.core.flag_runs import flag_runs
from flea_diag.core.machine_modes import OUT, MachineModes
from flea_diag.core.observers.innovation_residual import normalised
from flea_diag.core.observers.observer_block import innovated_places
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.parameters import (
    UNIT_PARAMETERS,
    ActuatorParameters,
    UnitTolerance,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.running_mean import rolling_means
from flea_diag.core.scan_counts import ScanCounts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Trace = Callable[[ActuatorParameters, Array], Array]
"""Innovation residuals of a whole recording by an observer of an actuator with these parameters,
shape (scans, innovations); the seed is fixed."""

Followed = Callable[[ObserverNoise, Sequence[tuple[ActuatorParameters, Array]]], Iterable[Array]]
"""Innovation residuals of recordings, each with the parameters for it, as by ``Observing``."""

SEED = 1  # any: the same recordings give the same limits
PIECE_SCANS = 1000  # assumption: size of a sample


@dataclass(frozen=True)
class ObserverStatistics:
    """Observer noise and innovation residuals learned from nominal recordings.

    ``residuals``: one array per recording, shape (scans, columns); ``spread``: see ``unit_spread``.
    """

    noise: ObserverNoise
    residuals: tuple[Array, ...]
    spread: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class Observing:
    """The state observer as recordings are judged with it."""

    relations: RelationSet
    period_s: float
    voltage_sampling: str
    noise: ObserverNoise

    def trace(self, tried: ActuatorParameters, rows: Array) -> Array:
        """Innovation residuals of a recording, shape (scans, innovations)."""
        observer = StateObserver(
            tried,
            self.relations,
            self.period_s,
            np.random.default_rng(SEED),
            noise=self.noise,
            voltage_sampling=self.voltage_sampling,
        )
        places = innovated_places(self.relations.residuals)
        if not self.relations.residuals.modes:
            return normalised(observer.follow(rows), places)
        found = np.full((len(rows), len(self.relations.residuals.innovations)), np.nan)
        for start, stop in flag_runs(followed_in(rows, self.relations, self.period_s)):
            observer.interrupt()
            found[start:stop] = normalised(observer.follow(rows[start:stop]), places)
        return found


def followed_in(rows: Array, relations: RelationSet, period_s: float) -> Flags:
    """Scans in which the equations of motion hold in every mode of the machine, shape (n,)."""
    known = relations.residuals
    modes = MachineModes(known.modes, period_s, ScanCounts(period_s, known.smoothing_s).kernel)
    lost = [k for k, mode in enumerate(known.modes) if not mode.followed]
    followed: Flags = (modes.step(rows)[0][:, lost] == OUT).all(axis=1)
    return followed


def learn(
    runs: Sequence[NominalRun],
    parameters: ActuatorParameters,
    relations: RelationSet,
    tolerance: UnitTolerance,
    period_s: float,
    voltage_sampling: str,
    judging: Sequence[ActuatorParameters] = (),
    followed: Followed | None = None,
) -> ObserverStatistics:
    """Fit noise levels, then compute residuals with them; unreliable voltage in ``runs`` is NaN.

    ``judging``: parameters for the residuals of each recording, fitted without it.
    ``followed`` computes them, by default one after the other. Nothing is learned for a stand
    whose description allows no state observer.

    Raises
    ------
    CalibrationError
        No recording is long enough.
    """
    tested = innovated_places(relations.residuals)
    if not tested:
        nothing = tuple(np.empty((len(run.rows), 0)) for run in runs)
        return ObserverStatistics(ObserverNoise(), nothing, {})
    free = [_free(run, relations, period_s) for run in runs]
    noise = noise_identification.fitted(free, parameters, relations, period_s, voltage_sampling)

    trace = Observing(relations, period_s, voltage_sampling, noise).trace
    rows = [run.rows for run in runs]
    judged = list(zip(judging or (parameters,) * len(rows), rows, strict=True))
    residuals = tuple(followed(noise, judged) if followed else starmap(trace, judged))
    spread = unit_spread(rows, parameters, tolerance, trace)
    named = zip(relations.residuals.innovations, spread.tolist(), strict=True)
    return ObserverStatistics(noise, residuals, {name: tuple(row) for name, row in named})


def _free(run: NominalRun, relations: RelationSet, period_s: float) -> NominalRun:
    """The longest stretch of a recording in which the equations of motion hold."""
    if not relations.residuals.modes:
        return run
    free = flag_runs(followed_in(run.rows, relations, period_s))
    start, stop = max(free, key=lambda ends: ends[1] - ends[0], default=(0, 0))
    return replace(run, rows=run.rows[start:stop])


def unit_spread(
    recordings: Sequence[Array],
    parameters: ActuatorParameters,
    tolerance: UnitTolerance,
    trace: Trace,
) -> Array:
    """Sensitivity of each innovation residual to each parameter that varies between units.

    Parameters
    ----------
    recordings
        Rows of nominal recordings, shape (scans, channels) each.

    Returns
    -------
    shape (innovations, unit parameters)
        Root mean square sensitivities, order of ``UNIT_PARAMETERS``.
    """
    chosen = recordings[:: max(1, len(recordings) // PIECES)][:PIECES]
    pieces = [rows[:PIECE_SCANS] for rows in chosen]
    nominal = [trace(parameters, rows) for rows in pieces]
    spread = np.zeros((nominal[0].shape[1], len(UNIT_PARAMETERS)))
    for k, name in enumerate(UNIT_PARAMETERS):
        step = getattr(tolerance, name)
        if not step:
            continue  # healthy units are alike in it
        other = replace(parameters, **{name: getattr(parameters, name) + step})
        moved = [trace(other, rows) - before for rows, before in zip(pieces, nominal, strict=True)]
        # Equal seeds: any difference left after smoothing over a window is due to the parameter.
        changes = [_smoothed(each[SETTLE_SCANS:]) for each in moved]
        seen = np.concatenate([each for each in changes if len(each)] or [spread[None, :, 0]])
        square = np.nansum(seen**2, axis=0) / np.maximum(np.isfinite(seen).sum(axis=0), 1)
        spread[:, k] = np.sqrt(square) / step
    return spread


def _smoothed(values: Array, window: int = 100) -> Array:
    return values[:0] if len(values) < window else rolling_means(values, window)
