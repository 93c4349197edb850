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

"""Bearing frequencies: how often a defect is struck per shaft revolution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from flea_diag.fields.values import Positive, within

ContactAngle = Annotated[float, within(0.0, 1.5)]


@dataclass(frozen=True)
class BallScrew:
    """Geometry of a ball screw whose nut does not turn.

    Orders assume pure rolling, as in a bearing whose inner race is the screw and whose balls are
    those of one turn of the helix.
    """

    pitch_diameter_m: Positive
    ball_diameter_m: Positive
    lead_m: Positive
    contact_angle_rad: ContactAngle = math.pi / 4.0
    spacing: Annotated[float, within(1.0, 10.0)] = 1.02
    """Distance between adjacent balls of the train, in ball diameters."""
    turns: Positive = 1.0
    """Turns of the screw for each turn of the motor."""

    def __post_init__(self) -> None:
        _check_balls(self.ball_diameter_m, self.pitch_diameter_m)

    def orders(self) -> dict[str, float]:
        """Orders of a defect on the nut, the screw and a ball (two strikes per spin)."""
        helix = math.atan(self.lead_m / (math.pi * self.pitch_diameter_m))
        balls = (
            math.pi * self.pitch_diameter_m
            / (math.cos(helix) * self.spacing * self.ball_diameter_m)
        )  # fmt: skip
        nut, screw, ball = _orders(
            balls, self.ball_diameter_m / self.pitch_diameter_m, self.contact_angle_rad
        )
        return {"nut": nut, "screw": screw, "ball": ball}


@dataclass(frozen=True)
class Bearing:
    """Geometry of a ball bearing whose outer race does not turn."""

    pitch_diameter_m: Positive
    ball_diameter_m: Positive
    balls: Annotated[int, within(3, 1000)]
    contact_angle_rad: ContactAngle = 0.0
    turns: Positive = 1.0
    """Turns of the inner race for each turn of the motor."""

    def __post_init__(self) -> None:
        _check_balls(self.ball_diameter_m, self.pitch_diameter_m)

    def orders(self) -> dict[str, float]:
        """Orders of a defect on the outer race, the inner race and a ball (two per spin)."""
        outer, inner, ball = _orders(
            self.balls, self.ball_diameter_m / self.pitch_diameter_m, self.contact_angle_rad
        )
        return {"outer": outer, "inner": inner, "ball": ball}


@dataclass(frozen=True)
class Gear:
    """A pair of wheels, by the teeth of one of them."""

    teeth: Annotated[int, within(3, 10_000)]
    turns: Positive = 1.0
    """Turns of that wheel for each turn of the motor."""


@dataclass(frozen=True)
class Kinematics:
    """What rolls and meshes in a drive; all of it follows the motor."""

    ball_screw: BallScrew | None = None
    bearing: Bearing | None = None
    gear: Gear | None = None

    def orders(self) -> dict[str, float]:
        """Order of each line of vibration: events for each turn of the motor."""
        found: dict[str, float] = {}
        if self.ball_screw:
            turns = self.ball_screw.turns
            found |= {name: turns * order for name, order in self.ball_screw.orders().items()}
        if self.bearing:
            turns, orders = self.bearing.turns, self.bearing.orders()
            found |= {f"bearing_{name}": turns * order for name, order in orders.items()}
        if self.gear:
            found["gear_mesh"] = self.gear.turns * self.gear.teeth
        return found


def _check_balls(ball_m: float, pitch_m: float) -> None:
    if not ball_m < pitch_m:
        raise ValueError(
            f"ball_diameter_m = {ball_m:g} must be below pitch_diameter_m = {pitch_m:g}"
        )


def _orders(balls: float, ratio: float, contact_angle: float) -> tuple[float, float, float]:
    """Strikes per revolution on the stationary race, the rotating race and a ball."""
    slope = ratio * math.cos(contact_angle)
    return (
        0.5 * balls * (1.0 - slope),
        0.5 * balls * (1.0 + slope),
        (1.0 - slope**2) / ratio,
    )
