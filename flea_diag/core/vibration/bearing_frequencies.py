"""Bearing frequencies: how often a defect is struck per shaft revolution."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class BallScrew:
    """Geometry of a ball screw whose nut does not turn.

    Orders assume pure rolling, as in a bearing whose inner race is the screw and whose balls are
    those of one turn of the helix.
    """

    pitch_diameter_m: float
    ball_diameter_m: float
    lead_m: float
    contact_angle_rad: float = math.pi / 4.0
    spacing: float = 1.02
    """Distance between adjacent balls of the train, in ball diameters."""

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

    pitch_diameter_m: float
    ball_diameter_m: float
    balls: int
    contact_angle_rad: float = 0.0

    def orders(self) -> dict[str, float]:
        """Orders of a defect on the outer race, the inner race and a ball (two per spin)."""
        outer, inner, ball = _orders(
            self.balls, self.ball_diameter_m / self.pitch_diameter_m, self.contact_angle_rad
        )
        return {"outer": outer, "inner": inner, "ball": ball}


def _orders(balls: float, ratio: float, contact_angle: float) -> tuple[float, float, float]:
    """Strikes per revolution on the stationary race, the rotating race and a ball."""
    slope = ratio * math.cos(contact_angle)
    return (
        0.5 * balls * (1.0 - slope),
        0.5 * balls * (1.0 + slope),
        (1.0 - slope**2) / ratio,
    )
