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

"""Temperatures of winding, housing, frame and nut, and their effect on other parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flea_diag.fields.values import AboveZero
from flea_sim_driver.plant.unit import SimulatedUnit


@dataclass(frozen=True)
class Heat:
    """What temperature does to a machine, and the lag of its thermocouples."""

    copper_per_k: float
    magnet_per_k: float
    grease_per_k: float
    sensor_lag_s: AboveZero
    reference_degc: float


@dataclass(frozen=True)
class Temperatures:
    """Node temperatures in degC, and the lagging readings of thermocouples on housing and nut."""

    winding: float
    housing: float
    frame: float
    nut: float
    housing_sensed: float
    nut_sensed: float
    ambient: float

    @classmethod
    def uniform(cls, degc: float, ambient: float) -> Temperatures:
        """The whole machine at one temperature, and the ambient temperature."""
        return cls(degc, degc, degc, degc, degc, degc, ambient)

    def after(
        self, dt: float, unit: SimulatedUnit, heat: Heat, copper_w: float, friction_w: float
    ) -> Temperatures:
        """The temperatures ``dt`` seconds later, with these losses."""
        to_housing = (self.winding - self.housing) / unit.winding_to_housing_k_w
        to_frame = (self.housing - self.frame) / unit.housing_to_frame_k_w
        to_room = (self.frame - self.ambient) / unit.frame_to_ambient_k_w
        from_nut = (self.nut - self.ambient) / unit.nut_to_ambient_k_w
        into_nut = unit.nut_heat_share * friction_w
        lag = 1.0 - math.exp(-dt / heat.sensor_lag_s)
        return Temperatures(
            self.winding + dt * (copper_w - to_housing) / unit.winding_heat_capacity_j_k,
            self.housing + dt * (to_housing - to_frame) / unit.housing_heat_capacity_j_k,
            self.frame + dt * (to_frame - to_room) / unit.frame_heat_capacity_j_k,
            self.nut + dt * (into_nut - from_nut) / unit.nut_heat_capacity_j_k,
            self.housing_sensed + lag * (self.housing - self.housing_sensed),
            self.nut_sensed + lag * (self.nut - self.nut_sensed),
            self.ambient,
        )


def warmed(unit: SimulatedUnit, heat: Heat, now: Temperatures) -> SimulatedUnit:
    """The unit's parameters at its present temperatures: R(T), K(T), B(T)."""
    return replace(
        unit,
        winding_resistance_ohm=unit.winding_resistance_ohm
        * (1.0 + heat.copper_per_k * (now.winding - heat.reference_degc)),
        force_constant_n_per_a=unit.force_constant_n_per_a
        * (1.0 + heat.magnet_per_k * (now.housing - heat.reference_degc)),
        viscous_friction_n_s_m=unit.viscous_friction_n_s_m
        * math.exp(heat.grease_per_k * (now.nut - heat.reference_degc)),
    )
