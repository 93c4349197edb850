"""Quantitative effect of each fault on the parity relations: one row of terms per fault.

A term says: in this residual the fault adds ``size[k] * gain * regressor``. Terms follow from the
relations by differentiation (``effects``). For the FLEA (primes are true values, unprimed ones
measured):

drag dfc, dB        mechanical  r = + dfc s(v) + dB v
winding short       electrical  r = - dR i - dK v          mechanical  r = + dK i
current  i = i' + b mechanical  r = + K b                  electrical  r = - R b
current  i = g i'   the same with b = (1 - 1/g) i, the reading with its zero i0
load     F = F' + b mechanical  r = - b                    (g: b = (1 - 1/g) F)
dead     y = c      the true signal, taken from the other relation's terms, is missing from r

Sizes are bounded to the range of the catalogue: a fault that would have to be larger or of
the opposite sign does not explain the residual.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Term:
    """``size[index] * gain * regressor`` in one residual."""

    residual: str
    regressor: str
    gain: float
    index: int = 0


@dataclass(frozen=True, slots=True)
class Size:
    """One size parameter of a fault: what it is, its unit and its bounds."""

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class FaultModel:
    """Additive model of one fault in the parity relations.

    ``roughness`` is the scatter of the fault's own effect, as a share of it: friction of a rubbing
    screw varies along the stroke, a sensor's scale factor does not.
    """

    fault: str
    sizes: tuple[Size, ...]
    terms: tuple[Term, ...]
    roughness: float = 0.0


REGRESSORS = (
    "one",
    "elapsed_s",
    "direction",
    "speed_m_s",
    "current_a",
    "motor_current_a",
    "load_n",
    "load_and_direction_n",
    "force_and_direction_n",
    "motor_force_n",
    "resisting_force_n",
    "rate_force_n",
    "motor_voltage_v",
    "emf_and_drop_v",
    "driving_voltage_v",
    "commanded_voltage_v",
    "motor_temperature_degc",
    "nut_temperature_degc",
    "ambient_temperature_degc",
    "position_m",
    "load_position_m",
    "encoder_m_s",
    "position_rate_m_s",
    "rate_direction",
)
"""Signals that fault models are made of. ``current_a`` is i - i0 and ``motor_current_a`` the
reading i itself, which is what a scale factor acts on. ``motor_force_n`` is K (i - i0),
``resisting_force_n`` is load, friction and inertia, ``rate_force_n`` is B v + M a,
``emf_and_drop_v`` is R (i - i0) + Ke v and ``driving_voltage_v`` is V - V0 - Ke v, what is left
to drive a current."""

MECHANICAL, ELECTRICAL, DRIVE = "parity_mechanical", "parity_electrical", "parity_drive"
KINEMATIC, SPEED = "parity_kinematic", "parity_speed"
