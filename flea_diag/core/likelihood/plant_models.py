"""Faults of screw, motor and supply: which parameters they change, within which bounds.

What such a change does to each relation is the derivative of the relation (``effects``). Drags that
grow with the force in the screw, and circuits that are open, are no change of one parameter: their
terms are written here.
"""

from __future__ import annotations

from flea_diag.core.likelihood.effects import Effects
from flea_diag.core.likelihood.fault_models import (
    DRIVE,
    ELECTRICAL,
    MECHANICAL,
    FaultModel,
    Size,
    Term,
)
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.relation_set import RelationSet

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


def drag_models(
    p: ActuatorParameters, relations: RelationSet, dragging: bool = False
) -> tuple[FaultModel, ...]:
    """Faults of the screw, by the drag that they add.

    ``dragging``: a jam and lost lubrication add a least drag, a spall may add none. For a screw
    that vibrates while no relation deviates.
    """
    fc, B = p.coulomb_friction_n, p.viscous_friction_n_s_per_m
    dry, viscous, forced = (
        (LEAST_DRY * fc, LEAST_VISCOUS * B, LEAST_FORCED) if dragging else (0.0, 0.0, 0.0)
    )
    effects = Effects(relations, p)
    jammed = _frictions(effects, (dry, INFINITE), 0.0, INFINITE, forced)
    dried = _frictions(effects, (0.0, DRIED * fc), viscous, DRIED * p.load_friction_ratio, forced)
    # A spall has next to no mean drag: no more than the variation between healthy units.
    rattle = effects.lost({"coulomb_friction_n": -1.0})
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


def plant_models(p: ActuatorParameters, relations: RelationSet) -> tuple[FaultModel, ...]:
    """Faults of screw, motor and supply that the parity relations can size."""
    effects = Effects(relations, p)
    constants = {
        "force_constant_n_per_a": p.force_constant_n_per_a,
        "back_emf_v_s_per_m": p.back_emf_v_s_per_m,
    }
    shorted = (
        *effects.lost({"winding_resistance_ohm": 1.0}, 0),
        *effects.lost(constants, 1),
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
    unpowered = (Term(DRIVE, "commanded_voltage_v", -1.0),)
    return (
        *drag_models(p, relations),
        FaultModel("winding_short", short, shorted),
        *(
            FaultModel(fault, sizes, terms)
            for fault in ("winding_open", "motor_failure")
            for sizes, terms in (((most,), opened), ((most, regained), nearer))
        ),
        FaultModel("motor_failure", (most,), effects.lost(constants)),
        FaultModel("supply_open", (most,), unpowered),
        FaultModel("supply_short", (most,), unpowered),
    )


def _frictions(
    effects: Effects,
    coulomb_n: tuple[float, float],
    least_viscous: float,
    most_share: float,
    least_forced: float,
) -> tuple[tuple[tuple[Size, ...], tuple[Term, ...]], ...]:
    """Shapes of a drag at the nut, within these bounds of its parts.

    The dry part of lost lubrication never holds the shaft against a force at which it counts as
    stalled.
    """
    rub = (
        *effects.lost({"coulomb_friction_n": -1.0}, 0),
        *effects.lost({"viscous_friction_n_s_per_m": -1.0}, 1),
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
        (drag + pressed, (*rub, *effects.lost({"load_friction_ratio": -1.0}, 2))),
        (forced, (Term(MECHANICAL, "force_and_direction_n", 1.0),)),
    )
