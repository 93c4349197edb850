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

"""The calibrated actuator: one frozen value per parameter, units in the names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.frozen import Frozen
from flea_diag.fields.values import NotNegative, Positive, within

LEAD = "encoder_m_per_rad"
"""Base parameter by which the speed of the shaft is that of the moved part."""
MOVING_WIDTHS = 2.5
"""Speed above which the actuator moves, in widths of its smooth friction: there friction has 99 %
of its full size, and its direction is known."""


@dataclass(frozen=True, slots=True)
class ActuatorParameters(Frozen):
    """Parameters of one actuator design in linear coordinates (at the nut).

    Defaults are neutral: they stand for what a description has no parameter for, so that no
    relation holds it. What has a range is positive on every actuator, and the diagnosis divides by
    most of it. The ranges are wide: a value outside is a typing error and would break the
    arithmetic.
    """

    force_constant_n_per_a: Annotated[float, within(1e-9, 1e9, above=0.0)] = 1.0
    back_emf_v_s_per_m: Annotated[float, within(1e-9, 1e9, above=0.0)] = 1.0
    winding_resistance_ohm: Annotated[float, within(1e-6, 1e6, above=0.0)] = 1.0
    winding_inductance_h: float = 0.0
    current_offset_a: float = 0.0
    voltage_offset_v: float = 0.0
    coulomb_friction_n: float = 0.0
    viscous_friction_n_s_per_m: float = 0.0
    load_friction_ratio: float = 0.0
    stribeck_speed_m_s: Annotated[float, within(1e-6, 1e3, above=0.0)] = 1.0
    reflected_mass_kg: Annotated[float, within(1e-12, 1e9, above=0.0)] = 1.0
    motor_heating_k_per_a2s: float = 0.0
    motor_cooling_s: Annotated[float, within(1.0, 1e9, above=0.0)] = 1.0
    nut_heating_k_per_j: float = 0.0
    nut_cooling_s: Annotated[float, within(1.0, 1e9, above=0.0)] = 1.0
    reference_temperature_degc: float = 0.0
    drive_gain: Annotated[float, within(1e-9, 1e9, above=0.0)] = 1.0
    drive_offset_v: float = 0.0
    position_offset_m: float = 0.0
    encoder_m_per_rad: float = 0.0
    supply_voltage_v: float = 0.0
    coupling_compliance_m_per_n: NotNegative = 0.0
    coupling_play_m: NotNegative = 0.0
    position_gain: Positive = 1.0
    drive_drop_v: float = 0.0

    @property
    def moving_m_s(self) -> float:
        """Speed above which the actuator moves."""
        return MOVING_WIDTHS * self.stribeck_speed_m_s


STANDARD = frozenset(entry.name for entry in fields(ActuatorParameters))
"""Parameters that every calibration holds; a description may name further ones."""


@lru_cache(maxsize=64)
def _holding(further: tuple[str, ...]) -> type[ActuatorParameters]:
    """Parameters that hold these besides, by their names."""
    if not further:
        return ActuatorParameters
    return make_dataclass(
        ActuatorParameters.__name__,
        [(name, float, field(default=0.0)) for name in further],
        bases=(ActuatorParameters,),
        frozen=True,
        slots=True,
        namespace={"__reduce__": _parts},
    )


def _parts(parameters: ActuatorParameters) -> tuple[Any, ...]:
    """How to make them in another process, which does not know their type."""
    return actuator_parameters, (asdict(parameters),)


def actuator_parameters(values: Mapping[str, float]) -> ActuatorParameters:
    """Parameters of these values, neutral where none is given; further names are held, too."""
    further = tuple(sorted(set(values) - STANDARD))
    return _holding(further)(**values)


def further_of(parameters: ActuatorParameters) -> dict[str, float]:
    """Those that only this description names."""
    return {name: value for name, value in asdict(parameters).items() if name not in STANDARD}


def as_record(parameters: ActuatorParameters) -> npt.NDArray[np.void]:
    """The same by the same names, shape (1,): what numba reads fields of."""
    names = [field.name for field in fields(parameters)]
    row = tuple(getattr(parameters, name) for name in names)
    return np.array([row], dtype=[(name, np.float64) for name in names])


@dataclass(frozen=True, slots=True)
class UnitTolerance(Frozen):
    """By how much healthy units of one design differ (one sigma), order of UNIT_PARAMETERS.

    A difference inside it is another unit, not a fault. What only some descriptions and recordings
    say is 0 elsewhere: then healthy units are taken as alike in it.
    """

    coulomb_friction_n: Positive
    viscous_friction_n_s_per_m: Positive
    reflected_mass_kg: Positive
    winding_resistance_ohm: Positive
    back_emf_v_s_per_m: Positive
    voltage_offset_v: Positive
    current_offset_a: Positive
    thermal_rate_k_per_s: Positive
    force_constant_n_per_a: NotNegative = 0.0
    drive_gain: NotNegative = 0.0
    drive_offset_v: NotNegative = 0.0
    position_offset_m: NotNegative = 0.0
    position_gain: NotNegative = 0.0
    drive_drop_v: NotNegative = 0.0


UNIT_PARAMETERS = tuple(
    entry.name for entry in fields(UnitTolerance) if entry.name != "thermal_rate_k_per_s"
)
"""Parameters in which healthy units of one design differ."""
ZEROS = ("voltage_offset_v", "current_offset_a", "drive_offset_v", "position_offset_m")
"""Those of them that differ from day to day: no mark of a unit."""
LATER_TOLERANCES = (
    "force_constant_n_per_a",
    "drive_gain",
    "drive_offset_v",
    "position_offset_m",
    "position_gain",
    "drive_drop_v",
)
"""The last of them, which older calibrations lack and only some descriptions state."""


@dataclass(frozen=True)
class UnitSpread:
    """Spread of parameters between the units of a calibration, one sigma; ``count`` of them.

    What their recordings do not fix in each unit by itself is not in it.
    """

    count: int = 0
    spread: Mapping[str, NotNegative] = field(default_factory=dict)
