"""Learn the offsets of this unit's current and voltage channels in the first seconds.

Healthy units, and one unit on two days, differ in the zero of these channels by more than
the faults that are to be found; a zero is not a fault. The first seconds of a recording fix
it: Bayesian least squares on both parity relations, with the unit spread as the prior and
wide priors for friction, so that a jam that is there from the start is not learned away.
After that nothing is learned any more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residual import UNIT_PARAMETERS

Array = npt.NDArray[np.float64]

# Friction, mass, resistance and back-EMF are free here: only the offsets are wanted.
_WIDE = {
    "coulomb_friction_n": 300.0,
    "viscous_friction_n_s_per_m": 5000.0,
    "reflected_mass_kg": 100.0,
    "winding_resistance_ohm": 1.0,
    "back_emf_v_s_per_m": 30.0,
}
_CURRENT = UNIT_PARAMETERS.index("current_offset_a")
_VOLTAGE = UNIT_PARAMETERS.index("voltage_offset_v")


@dataclass(frozen=True, slots=True)
class Offsets:
    """Corrections to add to the calibrated offsets, and what is still unsure of them."""

    current_a: float
    voltage_v: float
    current_sigma_a: float
    voltage_sigma_v: float

    def apply(self, parameters: ActuatorParameters) -> ActuatorParameters:
        """Parameters of this unit."""
        return replace(
            parameters,
            current_offset_a=parameters.current_offset_a + self.current_a,
            voltage_offset_v=parameters.voltage_offset_v + self.voltage_v,
        )

    def narrow(self, tolerance: UnitTolerance) -> UnitTolerance:
        """Spread that is left once the offsets are known."""
        return replace(
            tolerance,
            current_offset_a=self.current_sigma_a,
            voltage_offset_v=self.voltage_sigma_v,
        )


class OffsetLearning:
    """Accumulates residuals and their sensitivities to the unit's parameters."""

    def __init__(self, tolerance: UnitTolerance) -> None:
        sigma = [_WIDE.get(name, getattr(tolerance, name)) for name in UNIT_PARAMETERS]
        self._information = np.diag(1.0 / np.square(sigma))
        self._vector = np.zeros(len(UNIT_PARAMETERS))

    def add(self, residual: float, sensitivity: Array, variance: float) -> None:
        """One residual; ``variance`` includes how many samples make one independent sample."""
        if np.isfinite(residual) and np.isfinite(sensitivity).all():
            self._information += np.outer(sensitivity, sensitivity) / variance
            self._vector += sensitivity * residual / variance

    def offsets(self) -> Offsets:
        """Posterior mean and standard deviation of the two offsets."""
        covariance = np.linalg.inv(self._information)
        mean = covariance @ self._vector
        sigma = np.sqrt(np.diag(covariance))
        return Offsets(
            float(mean[_CURRENT]),
            float(mean[_VOLTAGE]),
            float(sigma[_CURRENT]),
            float(sigma[_VOLTAGE]),
        )
