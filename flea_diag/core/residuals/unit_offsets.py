"""Learn the offsets of this unit's current and voltage channels in the first seconds.

Healthy units, and one unit on two days, differ in the zero of these channels by more than
the faults that are to be found; a zero is not a fault. The first seconds of a recording fix
it: Bayesian least squares on the mechanical relation (current) and on the electrical one
(voltage), with the unit spread as the prior and wide priors for friction, so that a jam that
is there from the start is not learned away. After that nothing is learned any more.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.parameters import UnitTolerance
from flea_diag.core.residuals.residual import UNIT_PARAMETERS

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


class OffsetLearning:
    """Learns one offset, ``parameter``, from one residual and its sensitivities."""

    def __init__(self, parameter: str, tolerance: UnitTolerance) -> None:
        self._at = UNIT_PARAMETERS.index(parameter)
        sigma = [_WIDE.get(name, getattr(tolerance, name)) for name in UNIT_PARAMETERS]
        self._information = np.diag(1.0 / np.square(sigma))
        self._vector = np.zeros(len(UNIT_PARAMETERS))

    def add(self, residuals: Array, sensitivities: Array, variance: float) -> None:
        """Take n residuals, shape (n,), and sensitivities, shape (n, unit parameters).

        ``variance`` includes how many samples make one independent sample.
        """
        known = np.isfinite(residuals) & np.isfinite(sensitivities).all(axis=1)
        if not known.any():
            return
        s, r = sensitivities[known], residuals[known]
        # Accumulated, not summed: one after the other, however many come at once.
        outer = s[:, :, None] * s[:, None, :] / variance
        self._information = np.add.accumulate((self._information, *outer))[-1]
        # A residual r at the calibrated value wants the parameter moved by -r / (dr/dp).
        self._vector = np.subtract.accumulate((self._vector, *(s * r[:, None] / variance)))[-1]

    def offset(self) -> tuple[float, float]:
        """What to add to the calibrated offset, and its standard deviation."""
        covariance = np.linalg.inv(self._information)
        mean = covariance @ self._vector
        return float(mean[self._at]), float(covariance[self._at, self._at] ** 0.5)
