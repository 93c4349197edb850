"""The physics of the stand: motor, screw, coupling, load actuator and control loop.

Integrated at 2 kHz: the winding exactly (its time constant equals the step), the friction as
an impulse that can stop a mass and never turns it, the rest semi-implicitly. The coupling
mode, near 45 Hz, takes forty steps a period. Only +, -, *, / and sin are used inside the
loop, so that numba, where installed, gives the bits of plain Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

STEP_S = 0.5e-3
STATES = (
    "current", "speed", "position", "load_speed", "load_position", "load_current", "trim", "felt",
    "wound", "slack", "wish",
)  # fmt: skip
SIGNALS = (
    "current", "voltage", "command", "speed", "position", "load_position", "force",
    "load_current", "friction_power",
)  # fmt: skip
Array = npt.NDArray[np.float64]


class Coefficients(NamedTuple):
    """Everything the integrator needs, constant over one call; linear coordinates, SI."""

    resistance: float
    current_decay: float
    force_constant: float
    mass: float
    coulomb: float
    stribeck: float
    stribeck_speed: float
    viscous: float
    load_friction: float
    backlash: float
    lead_error: float
    ripple: float
    ripple_order: float
    eccentric: float
    spall: float
    spall_order: float
    screw_ratio: float
    nominal_supply: float
    supply: float
    supply_resistance: float
    current_limit: float
    dead_time_drop: float
    bridge: float
    position_gain: float
    position_knee: float
    position_reset: float
    reset_limit: float
    droop: float
    droop_lag: float
    feedback_scale: float
    feedback_offset: float
    feedback_noise: float
    current_feedback_scale: float
    current_feedback_offset: float
    current_feedback_noise: float
    force_feedback_scale: float
    force_feedback_offset: float
    force_feedback_noise: float
    coupling_stiffness: float
    coupling_damping: float
    load_mass: float
    load_coulomb: float
    load_viscous: float
    load_drag: float
    load_drag_speed: float
    rough_rest: float
    rough_speed: float
    rough_load: float
    load_constant: float
    load_lag: float
    brake: float
    brake_knee: float
    brake_limit: float
    brake_wind: float
    brake_slack: float
    brake_catch: float
    trim_rate: float
    trim_limit: float
    stroke: float
    stop_stiffness: float
    stop_damping: float


def _stopped(speed: float, impulse: float) -> float:
    """Speed after a friction impulse: slower, at most stopped, never turned."""
    if speed > impulse:
        return speed - impulse
    if speed < -impulse:
        return speed + impulse
    return 0.0


def _clipped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _integrate(
    state: Array, reference: Array, load: Array, noise: Array, c: Any, dt: float, out: Array
) -> None:
    """Advance ``state`` in place over ``len(reference)`` steps and fill ``out`` (n, signals)."""
    i, v, x, vl, xl, iz, trim, felt, wound, slack, wish = state
    for k in range(reference.shape[0]):
        # Position loop: soft near zero error, drooping with current, limited in current.
        seen = c.feedback_scale * x + c.feedback_offset + c.feedback_noise * noise[k, 0]
        error = reference[k] - seen
        sensed = c.current_feedback_scale * i + c.current_feedback_offset
        sensed += c.current_feedback_noise * noise[k, 0]
        felt += dt * (sensed - felt) / c.droop_lag
        command = c.position_gain * error * abs(error) / (abs(error) + c.position_knee)
        wish = _clipped(wish + dt * c.position_reset * error, c.reset_limit)
        command += wish - c.droop * felt
        # The drive's own limit acts within a PWM period: no more voltage than it allows.
        emf = c.force_constant * v
        allowed = c.current_limit * c.resistance
        command = min(max(command, emf - allowed), emf + allowed)
        command = _clipped(command, c.nominal_supply)
        available = max(c.supply - c.supply_resistance * abs(i), 0.0)
        # Winding, exact over the step; bridge 0 = high impedance, nothing flows.
        voltage = _clipped(command, available) - c.dead_time_drop * i / (abs(i) + 0.1)
        settled = (voltage - emf) / c.resistance
        i = settled + (i - settled) * c.current_decay
        if c.bridge == 0.0:
            i = 0.0
            voltage = emf
        # Coupling: backlash, then spring and damper that can only push.
        angle = x / c.screw_ratio
        gap = x + c.lead_error * math.sin(angle) - xl
        half = 0.5 * c.backlash
        force = 0.0
        if gap > half:
            force = max(c.coupling_stiffness * (gap - half) + c.coupling_damping * (v - vl), 0.0)
        elif gap < -half:
            force = min(c.coupling_stiffness * (gap + half) + c.coupling_damping * (v - vl), 0.0)
        # Motor and screw.
        ripple = c.ripple * math.sin(c.ripple_order * angle) + c.eccentric * math.sin(angle)
        if c.spall != 0.0:
            bump = math.sin(0.5 * c.spall_order * angle)
            bump = bump * bump
            bump = bump * bump
            ripple += c.spall * (bump * bump - 0.27)
        slip = v / c.stribeck_speed
        drag = c.coulomb + c.stribeck / (1.0 + slip * slip) + c.load_friction * abs(force)
        push = c.force_constant * i - c.viscous * v - force - ripple
        v = _stopped(v + dt * push / c.mass, dt * drag / c.mass)
        x += dt * v
        # Load actuator. With its command it hardly pushes; moved against it, it brakes hard, winds
        # up while the load is too large, lets go, and catches again once the load runs away.
        wanted = load[k]
        way = 1.0 if wanted >= 0.0 else -1.0
        measured = c.force_feedback_scale * force + c.force_feedback_offset
        measured += c.force_feedback_noise * noise[k, 0]
        trim = _clipped(trim + dt * c.trim_rate * (wanted - measured), c.trim_limit)
        against = way * vl
        effort = abs(wanted) / (abs(wanted) + c.brake_knee)
        grip = c.brake * effort * effort * effort
        target = 0.0
        if slack > 0.0:
            slack -= dt
            wound = 0.0
            if against > c.brake_catch or against < 0.0:
                slack = 0.0
        else:
            target = way * (wanted + trim) / c.load_constant + grip * max(against, 0.0)
            target = way * min(max(target, 0.0), c.brake_limit)
            wound = max(wound + dt * effort * (way * measured - abs(wanted)), 0.0)
            if wound > c.brake_wind:
                slack = c.brake_slack
        iz += dt * (target - iz) / c.load_lag
        stop = 0.0
        if xl > c.stroke:
            stop = max(c.stop_stiffness * (xl - c.stroke) + c.stop_damping * vl, 0.0)
        elif xl < 0.0:
            stop = min(c.stop_stiffness * xl + c.stop_damping * vl, 0.0)
        resist = c.load_constant * iz + c.load_viscous * vl + stop
        resist += c.load_drag * vl / (abs(vl) + c.load_drag_speed)
        # Bounded: noise that grows with speed without end would drive the speed.
        rough = c.rough_rest + c.rough_speed * min(abs(vl), 0.06)
        rough *= 1.0 + c.rough_load * min(abs(iz), 3.0)
        resist += rough * noise[k, 1]
        resist += noise[k, 2] * vl / (abs(vl) + 0.02)
        vl = _stopped(vl + dt * (force - resist) / c.load_mass, dt * c.load_coulomb / c.load_mass)
        xl += dt * vl
        out[k, 0] = i
        out[k, 1] = voltage
        out[k, 2] = command
        out[k, 3] = v
        out[k, 4] = x
        out[k, 5] = xl
        out[k, 6] = force
        out[k, 7] = iz
        out[k, 8] = (drag + c.viscous * abs(v)) * abs(v)
    state[0] = i
    state[1] = v
    state[2] = x
    state[3] = vl
    state[4] = xl
    state[5] = iz
    state[6] = trim
    state[7] = felt
    state[8] = wound
    state[9] = slack
    state[10] = wish


@lru_cache(maxsize=1)
def integrator() -> Callable[..., None]:
    """The integrator, compiled where numba is installed."""
    try:
        import numba
    except ImportError:
        return _integrate
    try:
        return _compiled(numba.njit(cache=True))
    except RuntimeError:  # nowhere to keep the compiled code: a read-only installation
        return _compiled(numba.njit)


def _compiled(compile_: Callable[[Any], Any]) -> Callable[..., None]:
    globals()["_stopped"] = compile_(_stopped)
    globals()["_clipped"] = compile_(_clipped)
    compiled: Callable[..., None] = compile_(_integrate)
    return compiled
