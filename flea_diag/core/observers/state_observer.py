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

"""Scans in, predictions out: a filter on the driven model, ready for the observer stage.

    r = y - ŷ(k | k-1)        for every measured channel (Narasimhan et al. 2010, section 3.1)

A filter that corrects itself smears a faulty sensor into its states, so once a fault has been
detected it is to be called with ``frozen``; what isolates faults are parity relations, which
need no state.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.observers.driven_model import STATES, WALK, DrivenModel
from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.observer_block import (
    TOLD,
    Innovations,
    ReadingColumns,
    Scans,
    row_layout,
)
from flea_diag.core.observers.observer_loops import Places, observe_of
from flea_diag.core.observers.observer_noise import ObserverNoise, reading_key
from flea_diag.core.observers.particle_filter import ParticleFilter
from flea_diag.core.observers.state_filter import Filter, Innovation
from flea_diag.core.observers.thermal_filter import ESTIMATE, EXCHANGE, heat_loops, thermal_filter
from flea_diag.core.observers.track_loops import LOST, WARMED
from flea_diag.core.residuals.driven_equations import DrivenChannels, driven_equations
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.errors import ConfigurationError, shown

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FILTERS = ("optimal", "bootstrap", "kalman")
SAMPLINGS = ("mean", "instant_pwm")
MEAN, LAST = STATES.index("mean_speed_m_s"), STATES.index("speed_m_s")
NOISES = 1000.0
"""Of a position's noise that stand for its travel where that is not known."""
WARMED_K = 0.5
"""Change of the winding temperature at which the resistance is updated."""


def _sigmas(noise: ObserverNoise, rows: ResidualSet, by: DrivenChannels) -> dict[str, float]:
    """Channel -> standard deviation of one reading: learned, or as described."""
    learned = dict(noise.readings)
    found = {
        name: learned.get(reading_key(name, rows.units[name]), rows.noise[name])
        for name in by.predicted
    }
    return {**found, by.voltage: noise.voltage_sample_v}


def _prior(extent: float) -> dict[str, float]:
    """Standard deviations of the states before the first scan, by the travel of the position.

    The last speed of a scan is near its mean speed.
    """
    mean, last = extent, extent + 0.005 * extent
    states = {"voltage_v": 10.0, "mean_speed_m_s": mean, "speed_m_s": last}
    return {**states, "position_m": 0.01 * extent}


class StateObserver:
    """Tracks one actuator through the channels of its scans, constant memory.

    Parameters
    ----------
    parameters
        Calibrated.
    relations
        Of the actuator that they are the parameters of.
    period_s
        Between scans.
    generator
        Source of randomness, of 64 bits; unused by the Kalman filter. The same seed, rows
        and backend give the same numbers.
    particles
        How many; unused by the Kalman filter.
    backend
        "numpy", "numba" or "auto".
    noise
        Noise levels, see ``noise_identification.fitted``.
    voltage_sampling
        "mean" or "instant_pwm", as the ChannelTable and the calibration say.
    kind
        "optimal", "bootstrap" (particle filters) or "kalman" (extended Kalman filter).
    expected
        Normalised innovation squared of a channel on healthy units.

    Attributes
    ----------
    channels
        Names of what is predicted, the order of every ``Innovation``.

    Raises
    ------
    ConfigurationError
        A parameter out of its limits, by name.
    """

    def __init__(
        self,
        parameters: ActuatorParameters,
        relations: RelationSet,
        period_s: float,
        generator: np.random.Generator,
        particles: int = 200,
        backend: str = "auto",
        *,
        noise: ObserverNoise | None = None,
        voltage_sampling: str = "mean",
        kind: str = "optimal",
        expected: float = 1.0,
    ) -> None:
        if kind not in FILTERS:
            raise ConfigurationError(
                f"filter {shown(kind)} is unknown, known are {', '.join(FILTERS)}"
            )
        if voltage_sampling not in SAMPLINGS:
            raise ConfigurationError(
                f"voltage sampling {shown(voltage_sampling)} is unknown, known are "
                f"{', '.join(SAMPLINGS)}"
            )
        if not period_s > 0.0:
            raise ConfigurationError(f"period_s = {period_s}: must be above 0 s")
        noise = ObserverNoise() if noise is None else noise
        # What no sensor of this stand reads is predicted, too.
        known, rows = relations.every or relations, relations.residuals
        equations = driven_equations(known, rows)
        by = equations.channels
        self.channels = by.predicted
        self._columns = ReadingColumns.of(rows, by)
        self._layout = row_layout(len(by.readings), len(by.heated))
        sigma = _sigmas(noise, rows, by)
        stores = [row for row in known.predictions if row.channel in by.heated]
        filters = [
            thermal_filter(
                period_s,
                noise.temperature_walk_k,
                sigma[row.channel],
                [known.exchange_rate(parameters, row.name, other) for other in by.around],
            )
            for row in stores
        ]
        self._stores = np.array(filters).reshape(len(stores), EXCHANGE + len(by.around))
        warm = next(iter(known.predicted.values()), "")
        self._winding = next((k for k, row in enumerate(stores) if row.name == warm), -1)
        cold = next(iter(known.reference.values()), math.nan)
        self._generator, self._particles = generator, particles
        self._kind, self._expected = kind, expected
        self.backend = "numpy" if kind == "kalman" else backends.chosen(backend)
        pwm = voltage_sampling == "instant_pwm"
        sigmas = tuple(sigma[name] for name in by.readings)
        described = rows.noise.get(by.position, 0.0)
        ends, walk = known.stop.high_m - known.stop.low_m, WALK * described
        self._extent = NOISES * described if math.isnan(ends) else ends
        self._model = DrivenModel(equations, parameters, period_s, noise, sigmas, walk, pwm, cold)
        self._compiled = self.backend == "numba" and kind == "optimal"
        self._places = Places.of(self._columns, self._model.absent, self._model.driving)
        self._filter: Filter | None = None

    @property
    def mean(self) -> Array:
        """Estimated states of motion, ``driven_model.STATES``; NaN before the first scan."""
        return np.full(len(STATES), math.nan) if self._filter is None else self._filter.mean

    @property
    def model(self) -> DrivenModel:
        """What the next scan is predicted by."""
        return self._model

    @property
    def tracking(self) -> Filter | None:
        """The filter as it stands; None before the first scan, and where the track is lost."""
        return self._filter

    def step(self, row: Array, frozen: bool = False) -> Innovation:
        """Take one scan, shape (channels,); see ``follow``."""
        return self.follow(row[None], frozen).scan(0)

    def follow(self, rows: Array, frozen: bool = False) -> Innovations:
        """Take n scans, one after another: the same bits for any division into blocks.

        Parameters
        ----------
        rows : shape (n, channels)
            Order of ``ResidualSet.channels``, NaN = not measured.
        frozen : bool
            Compare, but correct nothing.
        """
        count, at = len(rows), self._layout
        if self._compiled:
            found = Innovations.empty(at, count)
            done = 0
            while done < count:
                done += self._track(rows[done:], frozen, found.part(done))
            return found
        scans = self._read(rows)
        measured = np.isfinite(scans.y).sum(axis=1)
        raw, lost = np.empty((count, at.raw)), np.empty(count, dtype=bool)
        for done in range(count):
            self._one(scans, done, frozen, raw[done], lost)
        return Innovations.joined(at, raw, measured, lost)

    def _read(self, rows: Array) -> Scans:
        """Input of the filter."""
        model = self._model
        return Scans.read(rows, self._columns, model.absent, model.command, model.driving)

    def _track(self, rows: Array, frozen: bool, found: Innovations) -> int:
        """Leading scans in one compiled call; how many it has taken."""
        begun, model, at = self._filter is None, self._model, self._layout
        if begun:
            self._start(self._read(rows[:1]), 0)
        particles = self._filter
        assert isinstance(particles, ParticleFilter)
        motion = model.pwm, model.coefficients, model.record
        heat = self._stores, (self._winding, model.winding_degc, WARMED_K)
        told = found.table, found.measured, found.diverged, at.order
        numbers = at.motion, at.predicted, at.raw
        given = (self._places, model.command, numbers), motion, heat
        done, end = particles.track(
            observe_of(model.equations), rows, self._pattern, given, frozen, begun, told
        )
        self._end(end)
        return done

    def _pattern(self, row: Array) -> tuple[Array, Array, Array]:
        """Input, measurements, and those that count while frozen, of one scan."""
        scans = self._read(row[None])
        return scans.u[0], scans.y[0], scans.held[0]

    def _start(self, scans: Scans, k: int) -> Filter:
        """A filter at scan k, whose readings are where it starts: nothing predicts them."""
        self._filter = self._started(scans.y[k], scans.u[k])
        scans.y[k] = scans.held[k] = math.nan
        return self._filter

    def _one(self, scans: Scans, k: int, frozen: bool, raw: Array, lost: Flags) -> None:
        """One scan of the loop in Python; ``track_loops`` does the same."""
        estimate = self._filter
        if estimate is None:
            estimate = self._start(scans, k)
        else:
            estimate.predict(scans.u[k])
        moved = estimate.update(scans.y[k], frozen=frozen)
        warm = self._layout.warm
        raw[:warm], lost[k] = moved.row, moved.diverged
        model = self._model
        estimated = (*moved.mean.tolist()[:2], model.winding_degc)
        flows = model.equations.functions["supplies"](model.parameters, estimated)
        readings = scans.degc[k].tolist()
        for j, store in enumerate(self._stores):
            told = raw[warm + TOLD * j : warm + TOLD * (j + 1)]
            heat_loops(store, readings, j, float(flows[j]), frozen, told)
        end = 0 if frozen or math.isfinite(moved.nis) else LOST
        changed = self._winding >= 0 and abs(self._winding_degc - model.winding_degc) > WARMED_K
        self._end(end | (WARMED if changed else 0))

    @property
    def _winding_degc(self) -> float:
        return float(self._stores[self._winding, ESTIMATE])

    def _end(self, end: int) -> None:
        """Work that the last scan requires before the next one."""
        if end & LOST:
            # The prediction does not fit at all: restart with the next scan.
            self.interrupt()
        if end & WARMED:
            self._renew(self._model.warmed(self._winding_degc))

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters (the learned offsets of this unit)."""
        self._renew(replace(self._model, parameters=parameters))

    def interrupt(self) -> None:
        """A gap in the stream: restart with the next scan, but keep the temperatures."""
        self._filter = None

    def _renew(self, model: DrivenModel) -> None:
        self._model = model
        if self._filter is not None:
            self._filter.adopt(model)

    def _started(self, y: Array, u: Array) -> Filter:
        """A filter at the first scan: the prior, corrected by the readings of that scan."""
        noise, sigma = self._model.noise, _prior(self._extent)
        current = self._model.channels.index(self._model.equations.channels.current)
        voltage = self._model.voltage_v(float(np.nan_to_num(y[current])))
        position = self._model.position_m(y)
        if math.isnan(position):
            position, sigma["position_m"] = 0.0, self._extent
        if not self._model.pwm and not math.isnan(u[0]):
            voltage, sigma["voltage_v"] = u[0], noise.voltage_v
        covariance = np.diag([sigma[name] ** 2 for name in STATES])
        covariance[LAST, MEAN] = covariance[MEAN, LAST] = covariance[MEAN, MEAN]
        # Particles drawn from so wide a prior would all miss the first readings.
        known = KalmanFilter(self._model, np.array([voltage, 0.0, 0.0, position]), covariance)
        known.update(y)
        if self._kind == "kalman":
            return KalmanFilter(self._model, known.mean, known.covariance, self._expected)
        return ParticleFilter(
            self._model,
            known.mean,
            known.covariance,
            self._generator,
            particles=self._particles,
            proposal=self._kind,
            backend=self.backend,
            expected=self._expected,
        )
