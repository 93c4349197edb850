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

"""Two foreign machines, drawn by a seed: what they are, and what their data sheets say of them.

``hoist`` lifts a carriage by a screw: voltage, current, speed, position, temperature and supply are
read, and a bridge of given duty passes its supply on. ``arm`` turns in the vertical plane: no
voltage, and a second angle beyond its gear. A data sheet is off by what such are off by; frictions
and laws are not those of the plant (bristles, heat, two masses).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from plant import GRAVITY, Course, Numbers, sine, steps

SPREAD = {
    "resistance": 0.04, "constant": 0.015, "dry": 0.12, "sticks": 0.2, "viscous": 0.12,
    "mass": 0.03, "bristles": 0.1, "housing_capacity": 0.05, "between": 0.1,
}  # fmt: skip
"""By how much units of one design differ, relative, one standard deviation."""
SHEET = ("resistance", "constant", "mass", "weight", "dry", "viscous", "capacity")
"""What a data sheet says of it, each off by 5 %."""


@dataclass(frozen=True)
class Foreign:
    """A machine with its sensors.

    ``ratio`` is the load's way for a radian of the motor, ``reach`` its usual amplitude, ``fast``
    its usual speed, ``arm`` the lever of a payload and 0 for one that slides. ``noise`` and
    ``grain`` are standard deviation and resolution of each channel.
    """

    name: str
    numbers: Numbers
    ratio: float
    reach: float
    fast: float
    arm: float
    payload: float
    noise: Mapping[str, float]
    grain: Mapping[str, float]
    sheet: Mapping[str, float]
    """Value of the data sheet over the true one."""

    @property
    def centre(self) -> float:
        """Middle of its motions."""
        return 2.0 * self.reach

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels in order."""
        return tuple(self.noise)

    def unit(self, seed: int) -> Numbers:
        """A unit of the design."""
        rng = np.random.default_rng((7, seed))
        draws = np.clip(rng.standard_normal(len(SPREAD)), -2.0, 2.0)
        shares = {n: 1.0 + s * d for (n, s), d in zip(SPREAD.items(), draws, strict=True)}
        return self.numbers._replace(**{n: getattr(self.numbers, n) * s for n, s in shares.items()})

    def course(self, rng: np.random.Generator, seconds: float) -> Course:
        """A motion of later use."""
        amplitude = self.reach * rng.uniform(0.6, 1.2)
        centre = self.centre + self.reach * rng.uniform(-0.2, 0.2)
        rate = min(rng.uniform(0.12, 0.3), self.fast / (2.0 * math.pi * amplitude))
        if rng.random() < 0.5:
            return sine(amplitude, rate, centre, seconds)
        rise = rng.uniform(0.7, 0.95)
        return steps(amplitude, 0.55 * rate, centre, seconds, rise)


# long: one table of numbers, drawn from top to bottom
def drawn(name: str, seed: int) -> Foreign:
    """A hoist or an arm whose numbers nobody has chosen."""
    rng = np.random.default_rng((11 if name == "hoist" else 12, seed))

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    slides = name == "hoist"
    supply = float(rng.choice([24.0, 36.0, 48.0, 72.0]))
    fast = between(0.08, 0.3) if slides else between(0.8, 2.0)
    load = between(15.0, 60.0) if slides else between(0.4, 2.5)
    weight = GRAVITY * load if slides else load * between(5.0, 12.0)
    constant = 0.55 * supply / fast
    holds = weight / constant
    resistance = 0.08 * supply / holds * between(0.6, 1.4)
    mass = load * between(0.3, 1.5)
    dry = weight * between(0.08, 0.25)
    reach = fast * between(0.8, 1.2)
    shake = 2.0 * math.pi * between(25.0, 45.0)
    stiffness = shake * shake / (1.0 / mass + 1.0 / load)
    numbers = Numbers(
        resistance=resistance,
        inductance=resistance * between(1e-3, 3e-3),
        constant=constant,
        mass=mass,
        load_mass=load,
        stiffness=stiffness,
        damping=0.1 * math.sqrt(stiffness * min(mass, load)),
        dry=dry,
        sticks=dry * between(0.1, 0.35),
        stick_speed=0.03 * fast,
        bristles=dry / (2e-4 * reach),
        bristle_damping=0.3 * math.sqrt(dry / (2e-4 * reach) * mass),
        viscous=dry / fast * between(0.5, 1.5),
        per_kelvin=-between(0.004, 0.012),
        weight=weight,
        level=0.0 if slides else 2.0 * reach + between(0.05, 0.4),
        turns=0.0 if slides else 1.0,
        supply=supply,
        duty=supply,
        share=1.0,
        supply_resistance=0.01 * supply / holds,
        ripple=0.004 * supply,
        weak=0.0,
        limit=5.0 * holds,
        winding_capacity=between(40.0, 120.0) * holds * holds * resistance / 10.0,
        housing_capacity=between(300.0, 800.0) * holds * holds * resistance / 10.0,
        between=between(2.0, 5.0) / (holds * holds * resistance / 10.0) / 10.0,
        outwards=between(10.0, 20.0) / (holds * holds * resistance / 10.0) / 10.0,
        ambient=21.0,
        place_gain=12.0,
        speed_gain=45.0 * (mass + load),
        speed_reset=300.0 * (mass + load),
    )
    ratio = between(6e-4, 3e-3) if slides else 1.0 / float(rng.choice([51, 80, 121, 160]))
    full = {"motor_current": 5.0 * holds, "motor_speed": fast / ratio, "place": 4.0 * reach}
    noise = {
        "motor_current": 3e-3 * full["motor_current"],
        "motor_speed": 2e-4 * full["motor_speed"],
        "actuator_position": 2e-6 * full["place"],
    }
    if slides:
        noise |= {"motor_voltage": 2e-3 * supply, "bus_voltage": 1e-3 * supply}
        noise |= {"commanded_voltage": 1e-4 * supply}
    else:
        noise |= {"load_position": 2e-5 * full["place"]}
    noise |= {"motor_temperature": 0.12}
    grain = {n: (0.1 if n == "motor_temperature" else 0.5 * s) for n, s in noise.items()}
    sheet = {n: float(np.exp(0.05 * rng.standard_normal())) for n in SHEET}
    payload = 0.25 * load if slides else 0.1 * load / 0.5**2
    arm = 0.0 if slides else 0.5
    return Foreign(name, numbers, ratio, reach, fast, arm, payload, noise, grain, sheet)


def readings(made: Foreign, signals: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """What its sensors read of the signals of a run, healthy."""
    true = {
        "motor_current": signals["current"],
        "motor_speed": signals["speed"] / made.ratio,
        "actuator_position": signals["place"],
        "motor_voltage": signals["voltage"],
        "commanded_voltage": signals["command"],
        "bus_voltage": signals["bus"],
        "load_position": signals["far_place"],
        "motor_temperature": signals["degc"],
    }
    found = {}
    for name in made.channels:
        noisy = true[name] + made.noise[name] * rng.standard_normal(len(true[name]))
        found[name] = np.round(noisy / made.grain[name]) * made.grain[name]
    slow = found["motor_temperature"]
    found["motor_temperature"] = np.repeat(slow[::50], 50)[: len(slow)]
    return found
