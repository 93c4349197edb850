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

"""The physics of the stand: motor, screw, coupling, load actuator and control loop.

Integrated at 2 kHz: the winding exactly (its time constant may equal the step), friction as an
impulse that can stop a mass but not reverse it, the rest semi-implicitly. The coupling mode of
the FLEA, near 45 Hz, has forty steps per period. The loop uses only +, -, *, /, sin and sqrt, so
that numba, where installed, gives the same bits as plain Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

STEP_S = 0.5e-3
STATES = (
    "current", "speed", "position", "load_speed", "load_position", "load_current", "trim", "felt",
    "wound", "slack", "wish", "slipped", "phase",
)  # fmt: skip
SIGNALS = (
    "current", "voltage", "command", "speed", "position", "load_position", "force",
    "load_current", "friction_power", "slipped", "supply", "drawn",
)  # fmt: skip
Array = npt.NDArray[np.float64]


def _stopped(speed: float, impulse: float) -> float:
    """Speed after a friction impulse: slower, at most stopped, never turned."""
    if speed > impulse:
        return speed - impulse
    if speed < -impulse:
        return speed + impulse
    return 0.0


def _clipped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _position_loop(
    c: Any, dt: float, wanted: float, noise: float, i: float, x: float, v: float, felt: float,
    wish: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Voltage command, soft near zero error and drooping with the current, and its states."""
    seen = c.feedback_scale * x + c.feedback_offset + c.feedback_noise * noise
    error = wanted - seen
    sensed = c.current_feedback_scale * i + c.current_feedback_offset
    sensed += c.current_feedback_noise * noise
    felt += dt * (sensed - felt) / c.droop_lag
    command = c.position_gain * error * abs(error) / (abs(error) + c.position_knee)
    wish = _clipped(wish + dt * c.position_reset * error, c.reset_limit)
    command += wish - c.droop * felt
    if c.rate_gain != 0.0:
        command -= c.rate_gain * v
    return command, felt, wish


def _link(c: Any, command: float, i: float, phase: float) -> tuple[float, float]:
    """Share of its supply that the link of the bridge has, and its phase in the ripple.

    The capacitor of the link carries the motor from one peak of the rectifier to the next. One that
    has lost its capacitance lets the voltage fall in between, by the current that is drawn.
    """
    if c.link_turns == 0.0:
        return 1.0, phase
    phase += c.link_turns
    if phase >= 1.0:
        phase -= 1.0
    drawn = max(command * i, 0.0) / c.nominal_supply
    fallen = min(c.link_ohm * drawn / c.nominal_supply, 1.0)
    return 1.0 + c.link_ripple * math.sin(2.0 * math.pi * phase) - fallen * phase, phase


def _drive(
    c: Any, command: float, emf: float, i: float, phase: float
) -> tuple[float, float, float, float, float]:
    """Limited command, voltage at the winding, current, voltage of the link, and its phase."""
    # The drive's current limit acts within a PWM period: no more voltage than it allows.
    allowed = c.current_limit * c.resistance
    command = min(max(command, emf - allowed), emf + allowed)
    command = _clipped(command, c.nominal_supply)
    share, phase = _link(c, command, i, phase)
    available = max(c.supply * share - c.supply_resistance * abs(i), 0.0)
    # Winding, exact over the step; bridge 0 = high impedance, no current.
    duty = c.duty * (1.0 - c.duty_droop * abs(i)) * share
    voltage = _clipped(command * duty, available) - c.dead_time_drop * i / (abs(i) + 0.1)
    # One leg of the bridge, which conducts while the command is positive, may be damaged.
    leg, decay = 0.0, c.current_decay
    if command > 0.0 and c.leg_resistance != 0.0:
        leg, decay = c.leg_resistance, c.leg_decay
    settled = (voltage - emf) / (c.resistance + leg)
    i = settled + (i - settled) * decay
    voltage -= leg * i
    if c.bridge == 0.0:
        i = 0.0
        voltage = emf
    return command, voltage, i, max(c.supply * share - c.supply_resistance * abs(i), 0.0), phase


def _coupling_force(c: Any, gap: float, closing: float) -> float:
    """Backlash, then a spring and a damper that can only push.

    One way the armature is pushed against its magnet, the other way the magnet has to hold it: by
    no more than its pull, beyond which a gap opens until the pull closes it; that the pull falls
    with the gap is neglected.
    """
    half = 0.5 * c.backlash
    if gap > half:
        return max(c.coupling_stiffness * (gap - half) + c.coupling_damping * closing, 0.0)
    if gap < -half:
        force = min(c.coupling_stiffness * (gap + half) + c.coupling_damping * closing, 0.0)
        return max(force, -c.coupling_holds)
    return 0.0


def _stop_force(c: Any, position: float, speed: float, low: float, high: float) -> float:
    """Force of the hard stops against a part: they push back, and never pull."""
    if position > high:
        return max(c.stop_stiffness * (position - high) + c.stop_damping * speed, 0.0)
    if position < low:
        return min(c.stop_stiffness * (position - low) + c.stop_damping * speed, 0.0)
    return 0.0


def _ripple_force(c: Any, angle: float, motor_angle: float) -> float:
    """Ball pass and spall by the screw's angle, eccentric rotor and cogging by the motor's."""
    ripple = c.ripple * math.sin(c.ripple_order * angle) + c.eccentric * math.sin(motor_angle)
    if c.cogging != 0.0:
        ripple += c.cogging * math.sin(c.cogging_order * motor_angle)
    if c.spall != 0.0:
        bump = math.sin(0.5 * c.spall_order * angle)
        bump = bump * bump
        bump = bump * bump
        ripple += c.spall * (bump * bump - 0.27)
    return ripple


def _load_control(
    c: Any, dt: float, wanted: float, measured: float, vl: float, wound: float, slack: float,
    trim: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Current setpoint of the load actuator, and the states of its control.

    It assists motion weakly and brakes opposing motion strongly. While the load is too large the
    brake integrates, then releases, and engages again once the load runs away.
    """
    way = 1.0 if wanted >= 0.0 else -1.0
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
    return target, wound, slack, trim


def _lever(c: Any, xl: float) -> float:
    """Lever of the crank over its lever when square; 1 without a crank."""
    if c.crank == 0.0:
        return 1.0
    sine = (xl - c.load_centre) / c.crank
    return math.sqrt(max(1.0 - sine * sine, 0.1))


def _load_resistance(
    c: Any, iz: float, vl: float, xl: float, roughness: float, drag_noise: float
) -> float:
    """Force of the load actuator against its motion: motor, friction, end stops, roughness."""
    stop = _stop_force(c, xl, vl, c.load_low, c.load_high)
    resist = c.load_constant * iz + c.load_viscous * vl + stop
    resist += c.load_drag * vl / (abs(vl) + c.load_drag_speed) + c.weight
    # Bounded: noise that grew with speed without limit would drive the speed.
    rough = c.rough_rest + c.rough_speed * min(abs(vl), 0.06)
    rough *= 1.0 + c.rough_load * min(abs(iz), 3.0)
    resist += rough * roughness
    if c.load_stiffness != 0.0:
        lever = _lever(c, xl)
        resist += c.load_stiffness * (xl - c.load_centre) / (lever * lever)
    if c.link_moment != 0.0:
        resist += c.link_moment * math.cos(xl - c.link_level)
    return resist + drag_noise * vl / (abs(vl) + 0.02)


def _integrate(
    state: Array, reference: Array, load: Array, noise: Array, c: Any, dt: float, out: Array
) -> None:
    """Advance ``state`` in place over ``len(reference)`` steps and fill ``out`` (n, signals)."""
    i, v, x, vl, xl, iz, trim, felt, wound, slack, wish, slipped, phase = state
    drawn = i
    for k in range(reference.shape[0]):
        # What a motor whose gear slips turns beyond the nut: its own sensor reads both.
        turned = x + slipped
        command, felt, wish = _position_loop(
            c, dt, reference[k], noise[k, 0], drawn, turned, v, felt, wish
        )
        emf = c.force_constant * v * (1.0 + c.slip)
        command, voltage, i, supply, phase = _drive(c, command, emf, i, phase)
        drawn = i + c.leak * voltage  # what the controller measures, before its leads
        # Motor and screw, against the coupling.
        angle = x / c.screw_ratio
        force = _coupling_force(c, x + c.lead_error * math.sin(angle) - xl, v - vl)
        slip = v / c.stribeck_speed
        dry = c.coulomb
        if c.friction_wave != 0.0:
            dry *= 1.0 + c.friction_wave * math.sin(c.wave_number * x)
        drag = dry + c.stribeck / (1.0 + slip * slip) + c.load_friction * abs(force)
        push = c.force_constant * i - c.viscous * v - force - c.unseen_load
        push -= _ripple_force(c, angle, x / c.motor_ratio)
        push -= _stop_force(c, x, v, c.nut_low, c.nut_high)
        v = _stopped(v + dt * push / c.mass, dt * drag / c.mass)
        x += dt * v
        slipped += dt * c.slip * v
        # Load actuator.
        measured = c.force_feedback_scale * force + c.force_feedback_offset
        measured += c.force_feedback_noise * noise[k, 0]
        wanted = load[k] / _lever(c, xl)
        target, wound, slack, trim = _load_control(c, dt, wanted, measured, vl, wound, slack, trim)
        iz += dt * (target - iz) / c.load_lag
        resist = _load_resistance(c, iz, vl, xl, noise[k, 1], noise[k, 2])
        vl = _stopped(vl + dt * (force - resist) / c.load_mass, dt * c.load_coulomb / c.load_mass)
        xl += dt * vl
        row = out[k]
        row[0], row[1], row[2] = i, voltage, command
        row[3], row[4], row[5] = v, x, xl
        row[6], row[7] = force, iz
        row[8] = (drag + c.viscous * abs(v)) * abs(v)
        row[9] = slipped
        row[10], row[11] = supply, drawn
    state[:] = (i, v, x, vl, xl, iz, trim, felt, wound, slack, wish, slipped, phase)


PARTS = (
    _stopped, _clipped, _position_loop, _link, _drive, _coupling_force, _ripple_force,
    _load_control, _stop_force, _load_resistance, _lever,
)  # fmt: skip
"""What ``_integrate`` calls."""


@lru_cache(maxsize=1)
def integrator() -> Callable[..., None]:
    """The integrator, compiled where numba is installed."""
    if find_spec("numba") is None:
        return _integrate
    from flea_diag import compile_cache

    compiled: Callable[..., None] = compile_cache.compiled(_integrate, PARTS, {})
    return compiled
