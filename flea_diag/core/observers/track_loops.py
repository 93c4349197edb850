"""Many scans in one compiled call: the driven model, the particle filter and the temperatures.

For numba, as ``particle_loops``. A scan alone goes through here too, as a block of one: the same
machine code gives the same bits in whatever blocks the scans come.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from flea_diag.core.observers.normal_table import Indices
from flea_diag.core.observers.particle_kernel import Array
from flea_diag.core.observers.particle_loops import STEP, step_loops
from flea_diag.core.observers.resampling_loops import exp_loops

Flags = npt.NDArray[np.bool_]

LOST, WARMED = 1, 2
"""Nothing of what was predicted fits; the winding is so much warmer that its model changes."""


def tanh_loops(v: Array, found: Array) -> None:
    """Hyperbolic tangents, exact to some 1e-16 of one."""
    fall = np.empty_like(v)
    for i in range(len(v)):
        twice = -2.0 * abs(v[i])
        fall[i] = -700.0 if twice < -700.0 else twice
    exp_loops(fall, found)
    for i in range(len(v)):
        found[i] = math.copysign((1.0 - found[i]) / (1.0 + found[i]), v[i])


def transition_loops(x: Array, u: Array, pwm: bool, constants: Array, new: Array) -> None:
    """``driven_model.transition_numpy``."""
    c = constants
    T, decay, gained, kept, averaged = c[0], c[1], c[2], c[3], c[4]
    force_per_volt, V0, drag, K, coulomb = c[5], c[6], c[7], c[8], c[9]
    ratio, viscous, sharp, conductance = c[10], c[11], c[12], c[13]
    held, balanced = pwm or math.isnan(u[0]), math.isnan(u[1])
    work = np.empty((4, x.shape[1]))
    scaled, direction, drive, friction = work[0], work[1], work[2], work[3]
    for i in range(x.shape[1]):
        scaled[i] = sharp * x[2, i]
    tanh_loops(scaled, direction)
    for i in range(x.shape[1]):
        load = u[1]
        if balanced:
            current = conductance * (x[0, i] - V0) - drag * x[1, i]
            load = K * current - coulomb * direction[i] - viscous * x[2, i]
        new[0, i] = x[0, i] if held else u[0]
        drive[i] = force_per_volt * (new[0, i] - V0) - load
        friction[i] = coulomb + ratio * abs(load)
        new[1, i] = drive[i] - friction[i] * direction[i]
        new[2, i] = decay * x[2, i] + gained * new[1, i]
        scaled[i] = sharp * new[2, i]
    tanh_loops(scaled, direction)
    for i in range(x.shape[1]):
        first = new[1, i]
        second = drive[i] - friction[i] * direction[i] - first
        new[1, i] = kept * x[2, i] + averaged * (first + 0.5 * second)
        new[2, i] += averaged * second
        new[3, i] = x[3, i] + T * new[1, i]


def heat_loops(
    node: Array, measured: float, heating: float, ambient: float, frozen: bool, told: Array
) -> None:
    """``ThermalFilter.step`` on its ``state``; told is its results and the estimate after it."""
    told[:] = math.nan
    if math.isnan(node[0]):
        node[0] = told[3] = measured
        return
    if not math.isnan(heating):
        node[0] += node[2] * heating
    if not math.isnan(ambient):
        node[0] -= node[3] * (node[0] - ambient)
    node[1] += node[4]
    total = node[1] + node[5]
    told[0], told[1], told[2] = node[0], measured - node[0], math.sqrt(total)
    if not frozen and not math.isnan(measured):
        gain = node[1] / total
        node[0] += gain * told[1]
        node[1] -= gain * node[1]
    told[3] = node[0]


def track_loops(
    x: Array,
    cloud: Array,
    scans: tuple[Array, Array, Array, Array],
    first: int,
    pattern: tuple[Flags, Array, Array],
    bits: tuple[Array, Indices],
    table: Array,
    threshold: float,
    motion: tuple[bool, Array],
    heat: tuple[Array, Array],
    frozen: bool,
    out: Array,
) -> tuple[int, int]:
    """Scan after scan until one needs what is not compiled; see ``observer_block``.

    Particles, cloud and thermal nodes are renewed in place. With a scan whose missing inputs or
    channels are not those of ``pattern`` nothing has been done.

    Returns
    -------
    How many scans were taken, and with what the last of them ended it: ``LOST``, ``WARMED``, 0.
    """
    U, Y, held, degc = scans
    known, flat, idle = pattern
    uniform, chosen = bits
    pwm, constants = motion
    nodes, law = heat
    conductance, zero, drag, copper, rubbing, cold, warmed = (
        law[0], law[1], law[2], law[3], law[4], law[5], law[6])  # fmt: skip
    n, p = len(x), Y.shape[1]
    moved, apart = np.empty_like(x), np.empty_like(cloud)
    spare = np.empty(3 * p + n + 2)
    at = len(spare)
    for done in range(len(uniform)):
        k = first + done
        u, told, seed, drawn = U[k], out[k, :at], uniform[done], chosen[done]
        for b in range(len(u)):
            if math.isnan(u[b]) == known[b]:
                return done, 0
        transition_loops(x, u, pwm, constants, moved)
        apart[:] = cloud
        weights = apart if frozen else cloud
        if not step_loops(moved, weights, x, Y[k], u, flat, seed, drawn, table, threshold, told):
            return done, 0
        if frozen:
            # Compared with all, moved by what drives it alone.
            step_loops(moved, cloud, x, held[k], u, idle, seed, drawn, table, threshold, spare)
            told[3 * p : -2] = spare[3 * p : -2]
        speed = told[3 * p + 1]
        current = conductance * (told[3 * p] - zero - drag * speed)
        motor, nut = out[k, at : at + 4], out[k, at + 4 :]
        heat_loops(nodes[0], degc[k, 0], copper * current * current, degc[k, 2], frozen, motor)
        heat_loops(nodes[1], degc[k, 1], rubbing * abs(speed), degc[k, 2], frozen, nut)
        end = 0 if frozen or math.isfinite(told[at - 2]) else LOST
        if abs(nodes[0, 0] - cold) > warmed:
            end |= WARMED
        if end:
            return done + 1, end
    return len(uniform), 0


TRANSITION = (transition_loops, tanh_loops, exp_loops)
TRACK = (track_loops, *STEP, *TRANSITION, heat_loops)
"""What ``backend.compiled`` takes: each function, and what it calls."""
