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

"""Models of sensor faults of a stand that has the balance of power alone, held against it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from support.observed import flea_parameters
from support.places import SHIPPED_STANDS

from flea_diag.configuration.description import compiled_relations, faults_of
from flea_diag.core.likelihood.effect_set import effect_set

Array = npt.NDArray[np.float64]
STAND = SHIPPED_STANDS["cranfield"]
RELATIONS = compiled_relations(STAND / "actuator.yaml")
EFFECTS = effect_set(RELATIONS, faults_of(STAND / "actuator.yaml", STAND / "faults.yaml").values())
P = flea_parameters(
    supply_voltage_v=44.0,
    current_offset_a=0.36,
    coulomb_friction_n=800.0,
    load_friction_ratio=0.27,
    reflected_mass_kg=470.0,
    viscous_friction_n_s_per_m=0.0,
)
N = 200


@dataclass(frozen=True)
class Readings:
    current_a: Array
    speed_m_s: Array
    acceleration_m_s2: Array
    load_n: Array

    @property
    def way(self) -> Array:
        return np.tanh(self.speed_m_s / P.stribeck_speed_m_s)

    @property
    def taken_w(self) -> Array:
        """Power of friction, load and acceleration, by hand."""
        dry_n = (800.0 + 0.27 * np.abs(self.load_n)) * self.way
        return (dry_n + self.load_n + 470.0 * self.acceleration_m_s2) * self.speed_m_s

    def of(self, names: tuple[str, ...]) -> list[Array]:
        known = {
            "motor_current": self.current_a,
            "d_actuator_position": self.speed_m_s,
            "d_d_actuator_position": self.acceleration_m_s2,
            "commanded_load": self.load_n,
            "direction": self.way,
        }
        return [known.get(name, np.full(N, np.nan)) for name in names]


def healthy() -> Readings:
    speed = 0.03 * np.sin(np.linspace(0.0, 20.0, N))
    load_n = np.where(np.arange(N) % 50 < 25, 196.0, -392.0)
    given = Readings(np.zeros(N), speed, np.gradient(speed, 0.04), load_n)
    return replace(given, current_a=0.36 + given.taken_w / 44.0)


def residual(read: Readings) -> Array:
    (found,) = RELATIONS.functions["relations"](P, read.of(RELATIONS.signals))
    return np.asarray(found)


def effect_of_one(fault: str, read: Readings) -> Array:
    (model,) = [m for m in EFFECTS.bound(P) if m.fault == fault]
    columns = EFFECTS.functions["columns"](P, read.of(EFFECTS.signals))
    values = dict(zip(EFFECTS.names, columns, strict=True))
    return sum((term.gain * values[term.regressor] for term in model.terms), np.zeros(N))


def test_a_scaled_supply_current_is_a_share_of_what_the_balance_expects_of_it() -> None:
    true = healthy()
    read = replace(true, current_a=1.2 * true.current_a)
    np.testing.assert_allclose(0.2 * effect_of_one("motor_current_scaling", read), residual(read))


def test_the_scatter_of_a_current_is_not_what_its_scaling_is_made_of() -> None:
    read = healthy()
    noise = np.random.default_rng(1).normal(size=N)
    noisy = replace(read, current_a=read.current_a + noise)
    one, other = (effect_of_one("motor_current_scaling", each) for each in (noisy, read))
    np.testing.assert_array_equal(one, other)


def test_a_scaled_position_scales_the_power_of_the_motion() -> None:
    true = healthy()
    # The smooth sign is that of the true speed: far from zero it is the same.
    read = replace(
        true, speed_m_s=1.25 * true.speed_m_s, acceleration_m_s2=1.25 * true.acceleration_m_s2
    )
    fast = np.abs(true.speed_m_s) > 0.015
    found = (1.0 - 1.0 / 1.25) * effect_of_one("actuator_position_scaling", read)
    inertia_w = 470.0 * read.speed_m_s * read.acceleration_m_s2
    by_hand = -0.2 * read.taken_w
    np.testing.assert_allclose(found, by_hand, atol=1e-9)
    # The error of the acceleration is that of the speed squared, which no size scales: left out.
    np.testing.assert_allclose(found[fast], (residual(read) + 0.16 * inertia_w)[fast], rtol=1e-2)
