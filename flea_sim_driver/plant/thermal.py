"""Temperatures of winding, housing, frame and nut, and their effect on other parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from flea_sim_driver.plant.unit import SimulatedUnit

COPPER_PER_K = 0.00393
MAGNET_PER_K = -0.001
GREASE_PER_K = -0.03
SENSOR_LAG_S = 2.0
REFERENCE_DEGC = 25.0


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
        self, dt: float, unit: SimulatedUnit, copper_w: float, friction_w: float
    ) -> Temperatures:
        """The temperatures ``dt`` seconds later, with these losses."""
        to_housing = (self.winding - self.housing) / unit.winding_to_housing_k_w
        to_frame = (self.housing - self.frame) / unit.housing_to_frame_k_w
        to_room = (self.frame - self.ambient) / unit.frame_to_ambient_k_w
        from_nut = (self.nut - self.ambient) / unit.nut_to_ambient_k_w
        into_nut = unit.nut_heat_share * friction_w
        lag = 1.0 - math.exp(-dt / SENSOR_LAG_S)
        return Temperatures(
            self.winding + dt * (copper_w - to_housing) / unit.winding_heat_capacity_j_k,
            self.housing + dt * (to_housing - to_frame) / unit.housing_heat_capacity_j_k,
            self.frame + dt * (to_frame - to_room) / unit.frame_heat_capacity_j_k,
            self.nut + dt * (into_nut - from_nut) / unit.nut_heat_capacity_j_k,
            self.housing_sensed + lag * (self.housing - self.housing_sensed),
            self.nut_sensed + lag * (self.nut - self.nut_sensed),
            self.ambient,
        )


def warmed(unit: SimulatedUnit, now: Temperatures) -> SimulatedUnit:
    """The unit's parameters at its present temperatures: R(T), K(T), B(T)."""
    return replace(
        unit,
        winding_resistance_ohm=unit.winding_resistance_ohm
        * (1.0 + COPPER_PER_K * (now.winding - REFERENCE_DEGC)),
        force_constant_n_per_a=unit.force_constant_n_per_a
        * (1.0 + MAGNET_PER_K * (now.housing - REFERENCE_DEGC)),
        viscous_friction_n_s_m=unit.viscous_friction_n_s_m
        * math.exp(GREASE_PER_K * (now.nut - REFERENCE_DEGC)),
    )
