"""Regressors of the fault models, computed from the signals of scans."""

from __future__ import annotations

from collections.abc import Mapping
from operator import itemgetter

from flea_diag.core.likelihood.fault_models import REGRESSORS
from flea_diag.core.residuals.parameters import ActuatorParameters
from flea_diag.core.residuals.residual import Signals, Value, direction, friction_n, motor_force_n
from flea_diag.core.residuals.residual_rows import TEMPERATURES

_IN_ORDER = itemgetter(*REGRESSORS)


def regressors(
    p: ActuatorParameters, s: Signals, expected: Mapping[str, Value]
) -> tuple[Value, ...]:
    """Values in the order of ``REGRESSORS``; ``elapsed_s`` is 0; it needs an onset.

    ``expected``: predicted reading of each of ``TEMPERATURES``, degC.
    """
    current = s.current_a - p.current_offset_a
    force = motor_force_n(p, s.current_a)
    inertia = p.reflected_mass_kg * s.acceleration_m_s2
    emf = p.back_emf_v_s_per_m * s.speed_m_s
    sign = s.direction
    values: dict[str, Value] = {
        "one": 1.0,
        "elapsed_s": 0.0,
        "direction": sign,
        "speed_m_s": s.speed_m_s,
        "current_a": current,
        "motor_current_a": s.current_a,
        "load_n": s.load_n,
        "load_and_direction_n": abs(s.load_n) * sign,
        "force_and_direction_n": abs(force) * sign,
        "motor_force_n": force,
        "resisting_force_n": s.load_n + (friction_n(p, s) + inertia),
        "rate_force_n": p.viscous_friction_n_s_per_m * s.speed_m_s + inertia,
        "motor_voltage_v": s.voltage_v,
        "emf_and_drop_v": p.winding_resistance_ohm * current + emf,
        "driving_voltage_v": s.voltage_v - p.voltage_offset_v - emf,
        "commanded_voltage_v": s.commanded_voltage_v,
        "position_m": s.position_m,
        "load_position_m": s.load_position_m,
        "encoder_m_s": p.encoder_m_per_rad * s.encoder_speed_rad_s,
        "position_rate_m_s": s.position_rate_m_s,
        "rate_direction": direction(p, s.position_rate_m_s),
        **{f"{name}_degc": expected[name] for name in TEMPERATURES},
    }
    found: tuple[Value, ...] = _IN_ORDER(values)
    return found
