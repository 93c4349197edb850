"""``residual_bank.ResidualBank`` as a loop, for numba to compile: the same bits as in Python.

The relations themselves are those of ``residual``: numba compiles the same lines.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.core.residuals import residual as r
from flea_diag.core.residuals.residual import Signals
from flea_diag.core.residuals.residual_rows import INDEX, RESIDUAL_INDEX
from flea_diag.core.residuals.thermal import ESTIMATE, advance

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

RELATIONS = (r.mechanical_n, r.electrical_v, r.drive_v, r.kinematic_m, r.speed_m_s)
SENSITIVITIES = (r.mechanical_spread, r.electrical_spread)
"""Called by name in ``parity_loops``, in this order: numba has no table of functions."""
_ROWS = r.PARITIES
_RELATION = tuple(RELATIONS.index(row.relation) for row in _ROWS)
_NORMALISED = tuple(row.normalised for row in _ROWS)
_SENSITIVITY = tuple(
    -1 if row.sensitivity is None else SENSITIVITIES.index(row.sensitivity) for row in _ROWS
)
_CURRENT, _VOLTAGE = INDEX["motor_current"], INDEX["motor_voltage"]
_COMMAND, _ENCODER = INDEX["commanded_voltage"], INDEX["motor_speed"]
_POSITION, _LOAD_POSITION = INDEX["actuator_position"], INDEX["load_position"]
_LOAD = INDEX["load_force"]
_MOTOR, _NUT = INDEX["motor_temperature"], INDEX["nut_temperature"]
_AMBIENT = INDEX["ambient_temperature"]
_OF_MOTOR, _OF_NUT = RESIDUAL_INDEX["motor_temperature"], RESIDUAL_INDEX["nut_temperature"]
_OF_AMBIENT = RESIDUAL_INDEX["ambient_temperature"]


def parity_loops(p: Any, s: Signals, values: Array, spread: Array) -> None:
    """``ResidualBank._parities`` of one scan."""
    sign = math.copysign(1.0, s.direction)
    formed = (
        r.mechanical_n(p, s), r.electrical_v(p, s), r.drive_v(p, s),
        r.kinematic_m(p, s), r.speed_m_s(p, s),
    )  # fmt: skip
    spreads = r.mechanical_spread(p, s), r.electrical_spread(p, s)
    place = 0
    for j in range(len(_RELATION)):
        factor = sign if _NORMALISED[j] else 1.0
        values[j] = factor * formed[_RELATION[j]]
        if _SENSITIVITY[j] >= 0:
            for u in range(spread.shape[1]):
                spread[place, u] = factor * spreads[_SENSITIVITY[j]][u]
            place += 1


def heat_loops(
    p: Any, nodes: tuple[Array, Array, Array], row: Array, current: float, speed: float,
    dt_s: float, frozen: bool, values: Array,
) -> float:  # fmt: skip
    """``ResidualBank._thermal`` of one scan."""
    ambient, nut, motor = nodes
    before, around = motor[ESTIMATE], row[_AMBIENT]
    excess = current - p.current_offset_a
    copper = p.motor_heating_k_per_a2s * (excess * excess)
    rubbing = p.nut_heating_k_per_j * p.coulomb_friction_n * abs(speed)
    values[_OF_AMBIENT] = advance(ambient, row[_AMBIENT], 0.0, around, dt_s, frozen)
    values[_OF_NUT] = advance(nut, row[_NUT], rubbing, around, dt_s, frozen)
    values[_OF_MOTOR] = advance(motor, row[_MOTOR], copper, around, dt_s, frozen)
    return 0.0 if math.isnan(before) else before - p.reference_temperature_degc


def bank_loops(
    rows: Array, smooth: Array, ways: Array, parameters: npt.NDArray[np.void],
    nodes: tuple[Array, Array, Array], limits: tuple[float, int, float], still: int, frozen: bool,
    told: tuple[Array, Array, Array, Flags],
) -> int:  # fmt: skip
    """Scan after scan; returns for how many scans it has stood still.

    ``ways`` are the smooth signs of the speed, ``limits`` the speed above which it moves, scans
    of a standstill, and the period. ``told`` is to be filled: values, spread, signals, moving.
    """
    p = parameters[0]
    moving_m_s, rest, dt_s = limits
    values, spread, table, moving = told
    for i in range(len(rows)):
        value, first, second = smooth[i, 0], smooth[i, 1], smooth[i, 2]
        speed, acceleration, rate = first[_POSITION], second[_POSITION], first[_POSITION]
        if p.encoder_m_per_rad != 0.0:
            speed = value[_ENCODER] * p.encoder_m_per_rad
            acceleration = first[_ENCODER] * p.encoder_m_per_rad
        current, load = value[_CURRENT], value[_LOAD]
        moves = abs(speed) > moving_m_s or abs(rate) > moving_m_s
        still = still + 1 if not moves and abs(speed) <= moving_m_s else 0
        push = r.push_n(p, current, load, acceleration)
        stalled = still > rest and abs(push) > r.STALL * r.dry_friction_n(p, load)
        moving[i] = moves or stalled
        s = Signals(
            current,
            value[_VOLTAGE],
            value[_COMMAND],
            speed,
            acceleration,
            load,
            value[_POSITION],
            value[_LOAD_POSITION],
            value[_ENCODER],
            rate,
            value[_MOTOR],
            value[_NUT],
            heat_loops(p, nodes, rows[i], current, speed, dt_s, frozen, values[i]),
            math.copysign(1.0, push) if stalled else ways[i],
        )
        for k in range(len(s)):
            table[i, k] = s[k]
        parity_loops(p, s, values[i], spread[i])
    return still


BANK = (
    bank_loops, parity_loops, heat_loops, advance, *RELATIONS, *SENSITIVITIES,
    r.push_n, r.motor_force_n, r.friction_n, r.dry_friction_n,
)  # fmt: skip
"""What ``backend.exact`` takes: the function, and what it calls."""
