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

"""State observer of the observer stage: estimates and filter health, innovations as residuals.

Until a detection the filter corrects its state with every scan. From then on it is frozen: it
predicts a healthy actuator under the measured voltage and load, so that a faulty sensor does not
corrupt the estimate. It restarts when the episode is closed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.observers.innovation_residual import normalised, output_of
from flea_diag.core.observers.observer_block import Innovations, innovated_places
from flea_diag.core.observers.state_observer import StateObserver
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_rows import ResidualSet

Array = npt.NDArray[np.float64]

KINDS = {"particle": "optimal", "kalman": "kalman"}
NONE = "none"


class ObserverOutput(NamedTuple):
    """Output of the state observer for n scans, columns in the order of ``channels``.

    ``estimates``: one-step predictions; ``sigmas``: expected standard deviations of the readings
    about them; both of shape (n, channels) in the units of the channels. ``health``, shape (n, 3):
    effective sample size (inf without particles), normalised innovation squared per channel
    (1 expected), and 1 while the filter has lost track, else 0.
    """

    channels: tuple[str, ...]
    estimates: Array
    sigmas: Array
    health: Array


class StateEstimate:
    """A particle or Kalman filter on the scans of one stream, or no filter at all.

    None runs where the description names no innovations: it has no driven model, or no channels
    for one.
    """

    def __init__(
        self, calibration: Calibration, relations: RelationSet, kind: str, seed: int, backend: str
    ) -> None:
        known = relations.residuals
        predicted = known.predicted
        self._channels = tuple(name for name in predicted if name in calibration.channels)
        self._at = np.array([predicted.index(name) for name in self._channels], dtype=int)
        self._frozen = False
        self._compiled = backends.chosen(backend) == "numba"
        self._pwm = calibration.voltage_sampling == "instant_pwm"
        self._observer: StateObserver | None = None
        self._voltage, self._command = known.channel(known.voltage), known.channel(known.command)
        self._innovated, self._columns = innovated_places(known), known.innovation_columns
        if kind != NONE and self._innovated:
            self._observer = StateObserver(
                calibration.parameters,
                relations,
                calibration.period_s,
                np.random.default_rng(seed),
                backend=backend,
                noise=calibration.observer_noise,
                voltage_sampling=calibration.voltage_sampling or "mean",
                kind=KINDS[kind],
                expected=expected_nis(calibration, known),
            )

    @property
    def runs(self) -> bool:
        """Whether a filter runs."""
        return self._observer is not None

    def step(
        self,
        rows: Array,
        voltage_usable: npt.NDArray[np.bool_],
        frozen: bool,
        values: Array,
        void: bool = False,
    ) -> ObserverOutput:
        """Take rows of readings and fill the innovations among their residuals ``values``.

        While the equations of motion are ``void`` the filter starts anew with every scan: it
        follows the readings and there is nothing to test.
        """
        observer, count = self._observer, len(rows)
        if observer is None:
            nothing = np.empty((count, 0))
            return ObserverOutput((), nothing, nothing, nothing)
        if void:
            observer.interrupt()
            if count > 1:
                return self._one_by_one(rows, voltage_usable, frozen, values)
        if self._frozen and not frozen:
            observer.interrupt()
        self._frozen = frozen
        if np.count_nonzero(voltage_usable) < count:
            rows = rows.copy()
            rows[~voltage_usable, self._voltage] = math.nan
        found = observer.follow(rows, frozen)
        if self._compiled:
            return self._follow(found, rows, frozen, values)
        values[:, self._columns] = math.nan
        if not frozen:
            tested = normalised(found, self._innovated)
            # A mean voltage that no command corroborates is an input: its own error would appear
            # as an innovation. Raw PWM is a measurement.
            alone = np.isnan(rows[:, self._command]) if self._command >= 0 else True
            testable = np.full(count, self._pwm) | ~np.broadcast_to(alone, count)
            values[testable, self._columns] = tested[testable]
        sigmas = found.sigmas.take(self._at, axis=1)
        sigmas[sigmas == 0.0] = math.nan
        health = np.empty((count, 3))
        # A frozen filter does not track, so it cannot lose track.
        health[:, 0], health[:, 2] = found.ess, found.diverged & (not frozen)
        np.divide(found.nis, np.maximum(found.measured, 1), out=health[:, 1])
        return ObserverOutput(
            self._channels, found.predictions.take(self._at, axis=1), sigmas, health
        )

    def _one_by_one(
        self, rows: Array, voltage_usable: npt.NDArray[np.bool_], frozen: bool, values: Array
    ) -> ObserverOutput:
        """Scans while the equations of motion are void."""
        every = [slice(k, k + 1) for k in range(len(rows))]
        found = [self.step(rows[k], voltage_usable[k], frozen, values[k], True) for k in every]
        columns = (np.concatenate(column) for column in list(zip(*found, strict=True))[1:])
        return ObserverOutput(self._channels, *columns)

    def _follow(
        self, found: Innovations, rows: Array, frozen: bool, values: Array
    ) -> ObserverOutput:
        """The same as one compiled loop."""
        estimates, sigmas = np.empty((2, len(rows), len(self._at)))
        told = estimates, sigmas, np.empty((len(rows), 3))
        loop = output_of(self._innovated, self._columns.start)
        loop(tuple(found), rows, (self._pwm, self._command), frozen, self._at, told, values)
        return ObserverOutput(self._channels, *told)

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Use other parameters (the learned offsets of this unit)."""
        if self._observer is not None:
            self._observer.adopt(parameters)

    def interrupt(self) -> None:
        """A gap in the stream."""
        if self._observer is not None:
            self._observer.interrupt()


def expected_nis(calibration: Calibration, known: ResidualSet) -> float:
    """Normalised innovation squared of a channel on any healthy unit, at least 1.

    Its scatter over the nominal recordings, and what units differ by.
    """
    tolerance = np.array(calibration.tolerances())
    found = []
    for name in known.innovations[::2]:  # each also times the sign of the speed
        limit = calibration.limit(name)
        if limit is not None:
            apart = np.array(limit.spread) * tolerance[: len(limit.spread)]
            found.append(limit.sigma[0] ** 2 + float(np.square(apart).sum()))
    return max(1.0, float(np.mean(found))) if found else 1.0
