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

"""The actuator's equations written down by hand, as an oracle for what is derived from the graph.

Nothing of the package is used here. The equations are those of a DC motor, screw, compliant
load cell and driven load with two thermal nodes; ``series`` solves them as exact power series
in time with rational numbers, so that signs and orders of deviations are exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

ORDER = 6

PARAMETERS = {
    "drive_gain": "1",
    "winding_resistance": "2.95",
    "winding_inductance": "0.002",
    "back_emf_constant": "0.08924",
    "torque_constant": "0.08929",
    "rotor_inertia": "0.0000332",
    "screw_coulomb_friction": "0.02375",
    "screw_viscous_friction": "0.0001052",
    "screw_ratio": "0.00050532",
    "coupling_stiffness": "5000000",
    "coupling_damping": "3000",
    "load_mass": "100",
    "load_friction": "800",
    "winding_capacity": "30",
    "winding_housing_resistance": "1",
    "housing_capacity": "270",
    "housing_ambient_resistance": "2.6",
    "nut_heat_share": "0.6",
    "nut_capacity": "60",
    "nut_ambient_resistance": "4",
}
STATES = ("i", "omega", "stretch", "v_load", "T_winding", "T_housing", "T_nut", "x_nut", "x_load")
CHANNELS = (
    "motor_current",
    "motor_speed",
    "actuator_position",
    "load_position",
    "load_force",
    "motor_temperature",
    "nut_temperature",
)


def exact(**changes: Fraction) -> dict[str, Fraction]:
    """Parameters as fractions, some changed."""
    return {**{name: Fraction(text) for name, text in PARAMETERS.items()}, **changes}


def rates(x: dict[str, Any], u: dict[str, Any], p: dict[str, Any], friction: Any) -> dict[str, Any]:
    """Rates of all states; ``friction`` is the friction torque at x['omega']."""
    slip = p["screw_ratio"] * x["omega"] - x["v_load"]
    force = p["coupling_stiffness"] * x["stretch"] + p["coupling_damping"] * slip
    voltage = p["drive_gain"] * u["commanded_voltage"]
    back = p["winding_resistance"] * x["i"] + p["back_emf_constant"] * x["omega"]
    drive = p["torque_constant"] * x["i"] - friction - p["screw_ratio"] * force
    load = force - p["load_friction"] * x["v_load"] - u["commanded_load"]
    copper = p["winding_resistance"] * x["i"] * x["i"]
    inner = (x["T_winding"] - x["T_housing"]) * (1 / p["winding_housing_resistance"])
    outer = (x["T_housing"] - u["ambient_temperature"]) * (1 / p["housing_ambient_resistance"])
    cooling = (x["T_nut"] - u["ambient_temperature"]) * (1 / p["nut_ambient_resistance"])
    rubbing = p["nut_heat_share"] * (friction * x["omega"])
    return {
        "i": (voltage - back) * (1 / p["winding_inductance"]),
        "omega": drive * (1 / p["rotor_inertia"]),
        "stretch": slip,
        "v_load": load * (1 / p["load_mass"]),
        "T_winding": (copper - inner) * (1 / p["winding_capacity"]),
        "T_housing": (inner - outer) * (1 / p["housing_capacity"]),
        "T_nut": (rubbing - cooling) * (1 / p["nut_capacity"]),
        "x_nut": p["screw_ratio"] * x["omega"],
        "x_load": 1 * x["v_load"],
    }


def readings(x: dict[str, Any], p: dict[str, Any]) -> dict[str, Any]:
    """What the sensors of the stand read."""
    slip = p["screw_ratio"] * x["omega"] - x["v_load"]
    force = p["coupling_stiffness"] * x["stretch"] + p["coupling_damping"] * slip
    values = (x["i"], x["omega"], x["x_nut"], x["x_load"], force, x["T_housing"], x["T_nut"])
    return dict(zip(CHANNELS, values, strict=True))


def sliding_friction(omega: Any, p: dict[str, Any], direction: int) -> Any:
    """Ideal Coulomb and viscous friction while moving in one direction."""
    return direction * p["screw_coulomb_friction"] + p["screw_viscous_friction"] * omega


def smooth_friction(omega: float, p: dict[str, Any]) -> float:
    """The same with the smooth sign, of width 3 rad/s."""
    return (
        p["screw_coulomb_friction"] * math.tanh(omega / 3.0) + p["screw_viscous_friction"] * omega
    )


def steady(current: Fraction, speed: Fraction, p: dict[str, Fraction]) -> tuple[dict, dict]:
    """States and inputs that hold a current and a speed."""
    direction = 1 if speed > 0 else -1
    friction = sliding_friction(speed, p, direction)
    force = (p["torque_constant"] * current - friction) / p["screw_ratio"]
    velocity = p["screw_ratio"] * speed
    ambient = Fraction(24)
    copper = p["winding_resistance"] * current**2
    housing = ambient + copper * p["housing_ambient_resistance"]
    nut = ambient + p["nut_ambient_resistance"] * p["nut_heat_share"] * friction * speed
    winding = housing + copper * p["winding_housing_resistance"]
    half = Fraction(1, 20)
    stretch = force / p["coupling_stiffness"]
    values = (current, speed, stretch, velocity, winding, housing, nut, half, half)
    voltage = p["winding_resistance"] * current + p["back_emf_constant"] * speed
    return dict(zip(STATES, values, strict=True)), {
        "commanded_voltage": voltage,
        "commanded_load": force - p["load_friction"] * velocity,
        "ambient_temperature": ambient,
    }


@dataclass(frozen=True)
class Series:
    """Power series in time, cut after ORDER; enough arithmetic for the equations above."""

    terms: tuple[Fraction, ...]

    def __add__(self, other: Any) -> Series:
        return Series(tuple(a + b for a, b in zip(self.terms, lift(other).terms, strict=True)))

    __radd__ = __add__

    def __neg__(self) -> Series:
        return Series(tuple(-a for a in self.terms))

    def __sub__(self, other: Any) -> Series:
        return self + -lift(other)

    def __rsub__(self, other: Any) -> Series:
        return lift(other) - self

    def __mul__(self, other: Any) -> Series:
        a, b = self.terms, lift(other).terms
        return Series(tuple(sum(a[j] * b[k - j] for j in range(k + 1)) for k in range(len(a))))

    __rmul__ = __mul__


def lift(value: Any) -> Series:
    """A number as a constant series."""
    if isinstance(value, Series):
        return value
    return Series((Fraction(value), *(Fraction(0),) * ORDER))


def series(x0: dict, u: dict, p: dict, direction: int) -> dict[str, Series]:
    """Readings as power series in time from a state, inputs held."""
    known = {name: [Fraction(value)] for name, value in x0.items()}
    for order in range(ORDER):
        x = {n: Series((*c, *(Fraction(0),) * (ORDER + 1 - len(c)))) for n, c in known.items()}
        slopes = rates(x, u, p, sliding_friction(x["omega"], p, direction))
        for name, coefficients in known.items():
            coefficients.append(lift(slopes[name]).terms[order] / (order + 1))
    x = {name: Series(tuple(coefficients)) for name, coefficients in known.items()}
    return {channel: lift(value) for channel, value in readings(x, p).items()}


def deviation(
    quadrant: tuple[int, int], changes: dict[str, Fraction], extra: dict[str, Fraction]
) -> dict[str, str]:
    """Channel -> signs of the derivatives of its deviation, order 0 first.

    Parameters are multiplied by ``changes`` and inputs shifted by ``extra`` at time zero.
    """
    p = exact()
    x0, u = steady(Fraction(quadrant[0]), 60 * Fraction(quadrant[1]), p)
    faulty = {**p, **{name: p[name] * factor for name, factor in changes.items()}}
    shifted = {**u, **{name: u[name] + amount for name, amount in extra.items()}}
    before = series(x0, u, p, quadrant[1])
    after = series(x0, shifted, faulty, quadrant[1])
    return {c: "".join(_sign(t) for t in (after[c] - before[c]).terms) for c in CHANNELS}


def _sign(number: Fraction) -> str:
    return "+" if number > 0 else "-" if number < 0 else "0"


def cell(signs: str) -> str:
    """``0-(2)``: magnitude, slope and order of the first effect."""
    order = next((k for k, s in enumerate(signs) if s != "0"), None)
    if order is None:
        return "00"
    slope = next((s for s in signs[1:] if s != "0"), "0")
    return f"{signs[0]}{slope}({order})"
