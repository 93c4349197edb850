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

"""What healthy units of one design differ by; the relations say how it enters (``effect_set``)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, UnitTolerance

Array = npt.NDArray[np.float64]

WEIGHED_PARAMETERS = (
    "coulomb_friction_n",
    "viscous_friction_n_s_per_m",
    "winding_resistance_ohm",
    "back_emf_v_s_per_m",
    "voltage_offset_v",
)
"""Of these parameters those that a likelihood allows for. Not the inertia, which acts by less than
the noise, and not the zero of the current, which is learned at the start."""
LEAST = 1e-6
"""A spread of 0 would make a difference impossible, and its information infinite."""


def heating_rate(temperature: str) -> str:
    """By how much faster a part heats up than a model of one node says: hot for hours, or cold."""
    return f"{temperature}_rate_k_per_s"


def unit_differences(temperatures: Iterable[str]) -> tuple[str, ...]:
    """What healthy units differ by: their parameters, and how their parts heat up."""
    return (*UNIT_PARAMETERS, *map(heating_rate, temperatures))


def difference_sigmas(tolerance: UnitTolerance, names: Collection[str]) -> tuple[float, ...]:
    """By how much they differ (one sigma), in the order of ``unit_differences``."""
    rates = len(names) - len(UNIT_PARAMETERS)
    parts = [getattr(tolerance, name) for name in UNIT_PARAMETERS]
    return tuple(max(s, LEAST) for s in (*parts, *(tolerance.thermal_rate_k_per_s,) * rates))


@dataclass(frozen=True, slots=True)
class Unit:
    """What is known of a unit's own parameters, as a Gaussian in information form.

    ``information`` has shape (differences, differences), order of ``unit_differences``, and
    ``vector`` is information times mean.
    """

    information: Array
    vector: Array

    @classmethod
    def of(cls, tolerance: Sequence[float]) -> Unit:
        """Any healthy unit of the design."""
        return cls(np.diag(1.0 / np.square(tolerance)), np.zeros(len(tolerance)))

    @classmethod
    def unknown(cls, count: int) -> Unit:
        """Nothing is known of so many differences."""
        return cls.of([np.inf] * count)

    def shown(self, information: Array, vector: Array) -> Unit:
        """The same unit, after it has shown so much of itself."""
        return Unit(self.information + information, self.vector + vector)
