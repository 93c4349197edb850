"""Parity residuals, one row each, and the signals that the diagnosis reads beside them.

What is computed is compiled from the bond graph (``relation_set``); here is what it is called and
when it may be used. Multiplied by the sign of the speed (``_dn``, direction-normalised) a parameter
fault keeps one sign while a sensor bias alternates; in the raw residual it is the other way round.

Linear coordinates throughout: forces and speeds at the nut. Where the actuator stands under a
push that moves any healthy one, its direction is the sign of the push: it should go that way, and
what it lacks is a drag.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flea_diag.core.residuals.parameters import ActuatorParameters

Value = Any
"""A float, or an array of one for each of many scans: types cannot follow sums of the two."""


def direction(parameters: ActuatorParameters, speed_m_s: Value) -> Value:
    """Smooth sign of the speed."""
    # numpy's, also for one number: that of the mathematics library differs in the last bit.
    sign: Value = np.tanh(speed_m_s / parameters.stribeck_speed_m_s)
    # Numbers of numpy's own are ten times slower than Python's in all that follows.
    return float(sign) if isinstance(speed_m_s, float) else sign


STALL = 3.0
"""No healthy screw withstands a push of so many times its dry friction for long. At rest nominal
recordings of the FLEA show 2.6 times for half a second, and 3.5 times for a few scans, which the
means over windows bear."""


@dataclass(frozen=True, slots=True)
class Parity:
    """One row of the residual set.

    ``needs`` names the channels without which there is no residual, ``relation`` the relation of
    the set that it is the value of; ``differs`` says whether healthy units differ in it.
    """

    name: str
    unit: str
    needs: tuple[str, ...]
    gated: bool
    normalised: bool
    relation: str
    differs: bool


UNIT_PARAMETERS = (
    "coulomb_friction_n",
    "viscous_friction_n_s_per_m",
    "reflected_mass_kg",
    "winding_resistance_ohm",
    "back_emf_v_s_per_m",
    "voltage_offset_v",
    "current_offset_a",
)
"""Parameters in which healthy units of one design differ; see ``UnitTolerance``."""


SPEED = "speed"
"""Stands for the channel the speed comes from: the encoder, or the slope of the position."""
_MECHANICAL = ("motor_current", "load_force", SPEED)
_ELECTRICAL = ("motor_voltage", "motor_current", SPEED)

_MOTION = ("actuator_position", "load_position")
_DRIVE = ("motor_voltage", "commanded_voltage")
_SPEEDS = ("motor_speed", "actuator_position")

PARITIES: tuple[Parity, ...] = (
    Parity("parity_mechanical", "N", _MECHANICAL, True, False, "parity_mechanical", True),
    Parity("parity_mechanical_dn", "N", _MECHANICAL, True, True, "parity_mechanical", True),
    Parity("parity_electrical", "V", _ELECTRICAL, False, False, "parity_electrical", True),
    Parity("parity_electrical_dn", "V", _ELECTRICAL, True, True, "parity_electrical", True),
    Parity("parity_drive", "V", _DRIVE, False, False, "parity_drive", False),
    Parity("parity_kinematic", "m", _MOTION, False, False, "parity_kinematic", False),
    Parity("parity_speed", "m/s", _SPEEDS, False, False, "parity_speed", False),
)
RELATIONS = tuple(dict.fromkeys(row.relation for row in PARITIES))
"""Relations that are compiled."""
PARITY_NAMED = {row.name: row for row in PARITIES}
