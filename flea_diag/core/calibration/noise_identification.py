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

"""Noise levels of the observer from nominal recordings.

The scatter of single readings follows from their third differences. The other levels (drift of
the mean voltage, unmodelled forces, current ripple, speed difference of shaft and nut from
backlash and lead errors) are fitted by maximum likelihood of the Kalman filter's innovations
(Schweppe 1965). The search multiplies by factors of two, then of the square root of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.kalman_bank import KalmanBank
from flea_diag.core.observers.observer_block import ReadingColumns, Scans
from flea_diag.core.observers.observer_noise import ObserverNoise, reading_key
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.smoothing import hann_kernels
from flea_diag.errors import CalibrationError

Array = npt.NDArray[np.float64]

FACTORS = (2.0, math.sqrt(2.0))
PIECES = 4  # assumption: size of a sample
PIECE_SCANS = 300  # assumption: size of a sample
SETTLE_SCANS = 50  # assumption: scans until the filter has forgotten its start
FREEDOM = 8.0
"""Degrees of freedom of Student's t distribution, assumed for the innovations."""


def fitted(
    runs: Sequence[NominalRun],
    parameters: ActuatorParameters,
    relations: RelationSet,
    period_s: float,
    voltage_sampling: str,
) -> ObserverNoise:
    """Noise levels of maximum likelihood on nominal recordings.

    Raises
    ------
    CalibrationError
        No recording is long enough.
    """
    rows = relations.residuals
    noise = _read_off(runs, rows, period_s)
    tried = _Trial(parameters, relations, period_s, voltage_sampling)
    stretches = [tried.stretch(piece, noise) for piece in _pieces(runs)]
    searched = _searched(rows, voltage_sampling == "mean")

    (best,) = tried.costs(stretches, (noise,))
    for factor in FACTORS:
        improved = True
        while improved:
            improved, left = False, searched
            while left:
                # Each of those left by itself: filters side by side cost little more than two.
                others = [noise.scaled(name, by) for name in left for by in (factor, 1.0 / factor)]
                costs = tried.costs(stretches, others)
                better = [k for k, cost in enumerate(costs) if cost < best - 1e-3]
                if not better:
                    break
                first = better[0]
                noise, best, improved = others[first], costs[first], True
                left = left[first // 2 + 1 :]
    return noise


def _pieces(runs: Sequence[NominalRun]) -> list[Array]:
    """Pieces from the middle of recordings, chosen evenly over all recordings."""
    usable = [run.rows for run in runs if len(run.rows) >= PIECE_SCANS]
    if not usable:
        raise CalibrationError(
            f"no recording is as long as {PIECE_SCANS} scans: the observer's noise cannot be fitted"
        )
    chosen = usable[:: max(1, len(usable) // PIECES)][:PIECES]
    starts = [(len(rows) - PIECE_SCANS) // 2 for rows in chosen]
    return [rows[at : at + PIECE_SCANS] for rows, at in zip(chosen, starts, strict=True)]


def _searched(rows: ResidualSet, mean: bool) -> tuple[str, ...]:
    """Levels that are fitted: the process, and readings that differ by more than their noise."""
    channels = (rows.current, rows.encoder) if mean else (rows.current,)
    keys = (reading_key(name, rows.units[name]) for name in channels if name in rows.observed)
    return ("voltage_v" if mean else "voltage_walk_v", "force_n", *keys)


def _read_off(runs: Sequence[NominalRun], rows: ResidualSet, period_s: float) -> ObserverNoise:
    readings = []
    for channel in rows.predicted:
        if channel == rows.voltage:
            continue
        columns = [run.rows[:, rows.index[channel]] for run in runs]
        scatter = np.concatenate([np.abs(np.diff(column, 3)) for column in columns])
        scatter = scatter[np.isfinite(scatter)]
        level = rows.noise[channel]
        if len(scatter):
            # Third differences of white noise have 20 times its variance.
            level = max(1.4826 * float(np.median(scatter)) / math.sqrt(20.0), 1e-9)
        readings.append((reading_key(channel, rows.units[channel]), level))
    noise = ObserverNoise(readings=tuple(readings))
    kernel = hann_kernels(31, period_s)[0]
    apart = [
        column[15:-15] - np.convolve(column, kernel, mode="valid")
        for column in (run.rows[:, rows.index[rows.voltage]] for run in runs)
        if len(column) > 31
    ]
    voltage = np.concatenate(apart) if apart else np.empty(0)
    voltage = voltage[np.isfinite(voltage)]
    if len(voltage):
        noise = replace(noise, voltage_sample_v=max(float(voltage.std()), 1e-3))
    return noise


@dataclass(frozen=True)
class _Stretch:
    """A piece of a recording, and what of it no searched level changes, for each scan.

    ``degc``: winding temperature of the model; ``warmth``: normalised innovation squared of the
    heated stores; ``stores``: how many of them are predicted; ``spread``: twice the sum of the
    logarithms of their standard deviations.
    """

    rows: Array
    scans: Scans
    degc: Array
    warmth: Array
    stores: Array
    spread: Array


@dataclass(frozen=True)
class _Trial:
    """Kalman filters of one actuator at levels of noise that are tried."""

    parameters: ActuatorParameters
    relations: RelationSet
    period_s: float
    voltage_sampling: str

    def observer(self, noise: ObserverNoise) -> StateObserver:
        """A Kalman filter at these levels."""
        return StateObserver(
            self.parameters,
            self.relations,
            self.period_s,
            np.random.default_rng(0),
            noise=noise,
            voltage_sampling=self.voltage_sampling,
            kind="kalman",
        )

    def stretch(self, rows: Array, noise: ObserverNoise) -> _Stretch:
        """A piece with the temperatures that a filter at the first levels has in it."""
        observer, degc, told = self.observer(noise), [], []
        model = observer.model
        columns = ReadingColumns.of(self.relations.residuals, model.equations.channels)
        scans = Scans.read(rows, columns, model.absent, model.command, model.driving)
        for row in rows:
            degc.append(observer.model.winding_degc)
            told.append(observer.step(row))
        motion = len(model.channels)
        residual, sigma = (
            np.array([getattr(each, name)[motion:] for each in told])
            for name in ("residual", "sigma")
        )
        seen = sigma > 0.0
        warmth = np.nansum((residual / np.where(seen, sigma, np.nan)) ** 2, axis=1)
        spread = 2.0 * np.log(sigma, where=seen, out=np.zeros(seen.shape)).sum(axis=1)
        return _Stretch(rows, scans, np.array(degc), warmth, seen.sum(axis=1), spread)

    def costs(self, stretches: Sequence[_Stretch], tried: Sequence[ObserverNoise]) -> list[float]:
        """Twice the negative log likelihood of a scan under Student's t, up to a constant.

        Gross errors have little weight, yet the noise cannot become arbitrarily small as with a
        bounded NIS. Noise levels at which rounding destroys a filter's covariance, or a prediction
        is no number, are refused.
        """
        try:
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                return self._costs(stretches, tried)
        except np.linalg.LinAlgError:
            if len(tried) == 1:
                return [math.inf]
            return [cost for each in tried for cost in self.costs(stretches, (each,))]

    def _costs(self, stretches: Sequence[_Stretch], tried: Sequence[ObserverNoise]) -> list[float]:
        bank = self._started(stretches, tried)
        models = [[self.observer(noise).model for noise in tried] for _ in stretches]
        total, count = np.zeros(len(tried)), 0
        for k in range(1, PIECE_SCANS):
            for number, each in enumerate(stretches):
                if each.degc[k] != models[number][0].winding_degc:
                    models[number] = [m.warmed(each.degc[k]) for m in models[number]]
                    bank.adopt(number, models[number])
            nis, sigma = bank.step(
                np.array([each.scans.u[k] for each in stretches]),
                np.array([each.scans.y[k] for each in stretches]),
            )
            if k < SETTLE_SCANS:
                continue
            warmth, stores, spread = (
                np.array([getattr(each, name)[k] for each in stretches])[:, None]
                for name in ("warmth", "stores", "spread")
            )
            seen = sigma > 0.0
            apart = 2.0 * np.log(sigma, where=seen, out=np.zeros(seen.shape)).sum(axis=2)
            tails = FREEDOM + seen.sum(axis=2) + stores
            cost = tails * np.log1p((nis + warmth) / FREEDOM) + apart + spread
            total += cost.sum(axis=0)
            count += len(stretches)
        return [float(each) if math.isfinite(each) else math.inf for each in total / count]

    def _started(self, stretches: Sequence[_Stretch], tried: Sequence[ObserverNoise]) -> KalmanBank:
        """Filters after the first scan."""
        filters, models = [], []
        for each in stretches:
            observers = [self.observer(noise) for noise in tried]
            for observer in observers:
                observer.follow(each.rows[:1])
            filters.append([o.tracking for o in observers if isinstance(o.tracking, KalmanFilter)])
            models.append([observer.model for observer in observers])
        return KalmanBank(filters, models)
