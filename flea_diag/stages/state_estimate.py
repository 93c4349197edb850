"""The state observer in the observer stage: estimates and health out, innovations as residuals.

Until a detection the filter corrects itself with every scan. From then on it is frozen: it
predicts what a healthy actuator would do under the measured voltage and load, so that a faulty
sensor does not smear. Once the episode is closed it begins anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core import innovation_residual
from flea_diag.core.calibration import Calibration
from flea_diag.core.parameters import ActuatorParameters
from flea_diag.core.residual_bank import INDEX
from flea_diag.core.state_observer import PREDICTED, StateObserver

Array = npt.NDArray[np.float64]

KINDS = {"particle": "optimal", "kalman": "kalman"}
NONE = "none"
_VOLTAGE, _COMMAND = INDEX["motor_voltage"], INDEX["commanded_voltage"]
_UNTOLD = [math.nan] * len(innovation_residual.COLUMNS)


@dataclass(frozen=True, slots=True)
class Told:
    """What one scan's estimate adds to the residuals: tuples in the order of their names.

    ``estimates`` are predictions from earlier scans, ``sigmas`` what each reading is expected
    to scatter by about them; ``health`` is effective sample size (inf without particles),
    normalised innovation squared per channel (1 expected), and 1 for a lost track.
    """

    channels: tuple[str, ...] = ()
    estimates: tuple[float, ...] = ()
    sigmas: tuple[float, ...] = ()
    health: tuple[float, ...] = ()


class StateEstimate:
    """A particle or Kalman filter over the scans of one stream, or nothing at all."""

    def __init__(self, calibration: Calibration, kind: str, seed: int, backend: str) -> None:
        self._channels = tuple(name for name in PREDICTED if name in calibration.channels)
        self._at = [PREDICTED.index(name) for name in self._channels]
        self._frozen = False
        self._pwm = calibration.voltage_sampling == "instant_pwm"
        self._observer: StateObserver | None = None
        if kind != NONE:
            self._observer = StateObserver(
                calibration.parameters,
                calibration.period_s,
                np.random.default_rng(seed),
                backend=backend,
                noise=calibration.observer_noise,
                voltage_sampling=calibration.voltage_sampling or "mean",
                kind=KINDS[kind],
            )

    def step(self, row: Array, voltage_usable: bool, frozen: bool, values: Array) -> Told:
        """Take one row of ``CHANNELS`` and fill the innovations among the residuals ``values``."""
        observer = self._observer
        if observer is None:
            return Told()
        if self._frozen and not frozen:
            observer.interrupt()
        self._frozen = frozen
        if not voltage_usable:
            row = row.copy()
            row[_VOLTAGE] = math.nan
        told = observer.step(row, frozen)
        # A mean voltage that no command corroborates is an input on trust: its own error would
        # read as an innovation. Raw PWM is a measurement among others.
        sound = self._pwm or not math.isnan(row[_COMMAND])
        usable = sound and not frozen
        values[innovation_residual.COLUMNS] = (
            innovation_residual.normalised(told) if usable else _UNTOLD
        )
        sigma = told.sigma[self._at]
        sigma[sigma == 0.0] = math.nan
        return Told(
            self._channels,
            tuple(told.prediction[self._at].tolist()),
            tuple(sigma.tolist()),
            (told.ess, told.nis / max(told.measured, 1), float(told.diverged)),
        )

    def adopt(self, parameters: ActuatorParameters) -> None:
        """Go on with other parameters (the offsets of this unit, once they are learned)."""
        if self._observer is not None:
            self._observer.adopt(parameters)

    def interrupt(self) -> None:
        """A gap in the stream."""
        if self._observer is not None:
            self._observer.interrupt()
