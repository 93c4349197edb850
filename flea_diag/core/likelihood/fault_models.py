"""Quantitative effect of each fault on the parity relations: one row of terms per fault.

A term says: in this residual the fault adds ``size[k] * gain * regressor``. With measured
voltage and load as inputs these are exact consequences of the relations in ``residual``
(primes are true values, unprimed ones measured):

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

from flea_diag.core.residuals.parameters import ActuatorParameters


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


Terms = tuple[Term, ...]
INFINITE = float("inf")
SPALL_DRAG_N = 20.0
ROUGHNESS = 0.3
"""Drag of the real jammed units scatters by about this share along the stroke."""
DRIED = 1.5
"""Largest dry friction that lost lubrication adds, as a multiple of the unit's own: its drag mainly
grows with speed. The real jammed unit added this much (110 N beside 45 N) and is not isolable from
it by slow channels; a stalled unit holds against twice as much."""
LEAST_DRY, LEAST_VISCOUS, LEAST_FORCED = 0.5, 0.3, 0.1
"""Least drag if a relation would show it: a jam adds at least this share of the unit's own dry
friction, lost lubrication of its viscous friction, either of them of the motor's force if the drag
grows with it. About the variation between healthy units."""
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


def drag_models(p: ActuatorParameters, dragging: bool = False) -> tuple[FaultModel, ...]:
    """Faults of the screw, by the drag that they add.

    ``dragging``: a jam and lost lubrication add a least drag, a spall may add none. For a screw
    that vibrates while no relation deviates.
    """
    fc, B = p.coulomb_friction_n, p.viscous_friction_n_s_per_m
    dry, viscous, forced = (
        (LEAST_DRY * fc, LEAST_VISCOUS * B, LEAST_FORCED) if dragging else (0.0, 0.0, 0.0)
    )
    jammed = _frictions((dry, INFINITE), 0.0, INFINITE, forced)
    dried = _frictions((0.0, DRIED * fc), viscous, DRIED * p.load_friction_ratio, forced)
    # A spall has next to no mean drag: no more than the variation between healthy units.
    rattle = (Term(MECHANICAL, "direction", 1.0),)
    rattling_n = (SPALL_DRAG_N, 0.0) if dragging else (SPALL_DRAG_N,)
    return (
        *(
            FaultModel(fault, sizes, terms, roughness)
            for fault, shapes in (("jam", jammed), ("ball_nut_friction", dried))
            for sizes, terms in shapes
            for roughness in (0.0, ROUGHNESS)
        ),
        *(
            FaultModel("spall", (Size("coulomb drag", "N", 0.0, most_n),), rattle)
            for most_n in rattling_n
        ),
    )


def plant_models(p: ActuatorParameters) -> tuple[FaultModel, ...]:
    """Faults of screw, motor and supply that the parity relations can size."""
    K, Ke = p.force_constant_n_per_a, p.back_emf_v_s_per_m
    shorted = (
        Term(ELECTRICAL, "current_a", -1.0, 0),
        Term(ELECTRICAL, "speed_m_s", -Ke, 1),
        Term(MECHANICAL, "current_a", K, 1),
    )
    short = (
        Size("resistance lost", "ohm", 0.0, 0.9 * p.winding_resistance_ohm),
        Size("constant lost", "1", 0.0, 0.9),
    )
    most = Size("share lost", "1", 0.7, 1.1)
    opened = (Term(ELECTRICAL, "driving_voltage_v", 1.0),)
    # The drive's gain includes the bridge drop at the usual current, which is now zero.
    regained = Size("bridge drop lost", "1", 0.0, 0.1)
    nearer = (*opened, Term(DRIVE, "commanded_voltage_v", 1.0, 1))
    torqueless = (Term(MECHANICAL, "current_a", K), Term(ELECTRICAL, "speed_m_s", -Ke))
    unpowered = (Term(DRIVE, "commanded_voltage_v", -1.0),)
    return (
        *drag_models(p),
        FaultModel("winding_short", short, shorted),
        *(
            FaultModel(fault, sizes, terms)
            for fault in ("winding_open", "motor_failure")
            for sizes, terms in (((most,), opened), ((most, regained), nearer))
        ),
        FaultModel("motor_failure", (most,), torqueless),
        FaultModel("supply_open", (most,), unpowered),
        FaultModel("supply_short", (most,), unpowered),
    )


def _frictions(
    coulomb_n: tuple[float, float], least_viscous: float, most_share: float, least_forced: float
) -> tuple[tuple[tuple[Size, ...], Terms], ...]:
    """Shapes of a drag at the nut, within these bounds of its parts.

    The dry part of lost lubrication never holds the shaft against a force at which it counts as
    stalled.
    """
    rub = (
        Term(MECHANICAL, "direction", 1.0, 0),
        Term(MECHANICAL, "speed_m_s", 1.0, 1),
    )
    drag = (
        Size("coulomb drag", "N", *coulomb_n),
        Size("viscous drag", "N s/m", least_viscous, INFINITE),
    )
    # Drag that grows with the force in the screw: with the load, or with the motor's force.
    pressed = (Size("load-dependent drag", "1", 0.0, most_share),)
    forced = (Size("force-dependent drag", "1", least_forced, 0.9),)
    return (
        (drag, rub),
        (drag + pressed, (*rub, Term(MECHANICAL, "load_and_direction_n", 1.0, 2))),
        (forced, (Term(MECHANICAL, "force_and_direction_n", 1.0),)),
    )
