"""What healthy units of one design differ by, and how it enters the relations beside a fault."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.residual import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_rows import TEMPERATURES
from flea_diag.core.residuals.thermal import CORRECTION_S

Array = npt.NDArray[np.float64]

UNIT_DIFFERENCES = (*UNIT_PARAMETERS, *(f"{name}_rate_k_per_s" for name in TEMPERATURES))
"""What healthy units differ by: their parameters, and by how much faster each part of them heats
up than a model of one node says. What has been hot for hours heats unlike what was cold."""
# How such a difference enters, beside the fault: (residual, difference, regressor, gain).
UNIT_TERMS: tuple[tuple[str, str, str, float], ...] = (
    ("parity_mechanical", "coulomb_friction_n", "direction", -1.0),
    ("parity_mechanical", "viscous_friction_n_s_per_m", "speed_m_s", -1.0),
    ("parity_electrical", "winding_resistance_ohm", "current_a", -1.0),
    ("parity_electrical", "back_emf_v_s_per_m", "speed_m_s", -1.0),
    ("parity_electrical", "voltage_offset_v", "one", -1.0),
    # The estimate that is frozen at the detection has lagged behind by its time of correction.
    *(
        (name, f"{name}_rate_k_per_s", regressor, gain)
        for name in TEMPERATURES
        for regressor, gain in (("one", CORRECTION_S), ("elapsed_s", 1.0))
    ),
)


@dataclass(frozen=True, slots=True)
class Unit:
    """What is known of a unit's own parameters, as a Gaussian in information form.

    ``information`` has shape (differences, differences), order of ``UNIT_DIFFERENCES``, and
    ``vector`` is information times mean.
    """

    information: Array
    vector: Array

    @classmethod
    def of(cls, tolerance: Sequence[float]) -> Unit:
        """Any healthy unit of the design."""
        return cls(np.diag(1.0 / np.square(tolerance)), np.zeros(len(tolerance)))

    @classmethod
    def unknown(cls) -> Unit:
        """Nothing is known."""
        return cls.of([np.inf] * len(UNIT_DIFFERENCES))

    def shown(self, information: Array, vector: Array) -> Unit:
        """The same unit, after it has shown so much of itself."""
        return Unit(self.information + information, self.vector + vector)
