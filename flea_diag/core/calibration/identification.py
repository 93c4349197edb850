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

"""Identify the actuator's parameters from nominal recordings, by robust linear regression.

Each relation is linear in its parameters, or in quotients of them, if all signals pass the same
smoothing kernel. The columns follow from the relations that run (``relation_fit``); heating and
cooling of the thermal nodes from one slope per run (``heat_identification``). For the FLEA:

    i = i0 + (F + (fc + c|F|) s(v) + B v + M a) / K            (Newton at the nut)
    V = V0 + R (1 + alpha dT) (i - i0) + Ke v                  (Kirchhoff)
    dT/dt = h (i - i0)^2 - (T - Ta) / tau                      (heat)

Standard errors are clustered by recording, because samples within one are far from independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flea_diag.core.calibration import heat_identification
from flea_diag.core.calibration.calibration import NominalRun
from flea_diag.core.calibration.heat_identification import NominalSignals
from flea_diag.core.calibration.identified import NOT_NEGATIVE, Identified, RelationFits, possible
from flea_diag.core.calibration.relation_fit import Regression
from flea_diag.core.calibration.robust_regression import robust_fit
from flea_diag.core.calibration.smoothed_columns import Array, Flags, Numbers, Smoothed, smooth
from flea_diag.core.residuals.channel_units import LOAD
from flea_diag.core.residuals.measured_graph import rate_symbol
from flea_diag.core.residuals.parameters import LEAD, actuator_parameters, further_of
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.settling import Ways, scans_of, scans_since_change, ways
from flea_diag.core.symbolic.expression import symbols
from flea_diag.errors import CalibrationError

RelationsOf = Callable[[bool], RelationSet]

MINIMUM_MOVING_S = 5.0  # assumption: size of a sample


def identify(
    runs: Sequence[NominalRun],
    relations_of: RelationsOf,
    kernel_length: int,
    period_s: float,
    folds: Sequence[str] = (),
) -> Identified:
    """Identify every parameter that the recordings allow.

    Parameters
    ----------
    relations_of
        Relations of the actuator, for an encoder whose lead is known, or without one.
    folds
        Of each recording what is left out together with it: its name, or its unit.

    Raises
    ------
    CalibrationError
        The recordings contain too little motion to identify the actuator.
    """
    drawn = relations_of(True)
    fold = _numbered(folds or tuple(map(str, range(len(runs)))))
    data = replace(smooth(runs, drawn.residuals, kernel_length, period_s), fold=fold)
    start = {n: v for n, v in drawn.described.items() if n != LEAD}
    if "stribeck_speed_m_s" not in start:
        raise CalibrationError(
            "the description has no base parameter stribeck_speed_m_s, the width of the smooth "
            "sign of friction, which says what is motion: add it to base_parameters"
        )
    result = Identified(actuator_parameters(start), without=[{} for _ in runs])
    result.missing(["winding_inductance_h"], "L/R is far below the scan period; an assumption")
    result.missing(["stribeck_speed_m_s"], "width of the smooth sign of friction; an assumption")
    result.missing(["reference_temperature_degc"], "where the resistance holds; a convention")
    _encoder(data, drawn, result)
    relations = relations_of(result.parameters.encoder_m_per_rad != 0.0)
    signals = data.signals(relations, result.parameters)
    moving_m_s = result.parameters.moving_m_s
    speed_m_s = data.speed(result.parameters)
    moving = np.abs(speed_m_s) > moving_m_s
    moved_s = float(moving.sum()) * period_s
    if moved_s < MINIMUM_MOVING_S:
        raise CalibrationError(
            f"the recordings hold {moved_s:.1f} s of motion above {moving_m_s:g} m/s, "
            f"{MINIMUM_MOVING_S} s are needed: record the actuator while it moves"
        )
    fit = RelationFits(data, relations, signals, result)
    steady = _settled(data, ways(moving, speed_m_s), period_s, kernel_length)
    _friction(fit, moving, steady)
    _electrical(fit)
    _drive(fit)
    _position(fit)
    _others(fit)
    nominal = NominalSignals(data.signals(relations, result.parameters), data.run)
    heat_identification.identify(runs, period_s, relations, nominal, result)
    return result


def _numbered(names: Sequence[str]) -> Numbers:
    """Names as numbers, in the order of their first appearance."""
    order = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([order[name] for name in names], dtype=np.int64)


def _encoder(data: Smoothed, relations: RelationSet, result: Identified) -> None:
    rows = data.rows
    use = data.with_values(rows.encoder, rows.position)
    signals = data.signals(relations, result.parameters) if use.any() else {}
    fit = RelationFits(data, relations, signals, result)
    relation, slope = next(iter(rows.of_one_speed), ""), rate_symbol(rows.position)
    made = fit.regression(relation, slope, [LEAD], use) if signals else None
    if made is None:
        result.missing([LEAD], "no motor_speed channel")
        return
    fit.take(made, use)


MASS = "reflected_mass_kg"
NEGATIVE = 3.0
"""Standard errors below 0 at which a friction is taken as absent."""
DRIVES = {
    "force_constant_n_per_a": "no balance of forces with a motor current",
    "supply_voltage_v": "no balance of power with the current of a supply",
}
"""What turns a current into a force or into power, and why it is not identified."""


def _settled(data: Smoothed, way: Ways, period_s: float, kernel_length: int) -> Flags:
    """Rows in which the balance with the friction has settled after a change of the motion."""
    own = [row.settles_s for row in data.rows.parities if row.relation == data.rows.friction]
    scans = scans_of(max(own, default=0.0), period_s, kernel_length)
    starts = np.flatnonzero(np.diff(data.run)) + 1
    since = np.concatenate([scans_since_change(part) for part in np.split(way, starts)])
    return np.asarray(since > scans)


def _friction(fit: RelationFits, moving: Flags, settled: Flags) -> None:
    """The balance that holds the friction: of forces, or of power."""
    rows, relation = fit.data.rows, fit.data.rows.friction
    names = (*NOT_NEGATIVE, *DRIVES, *fit.further(relation))
    use = moving.copy() if relation in rows.in_motion else settled
    found = _not_negative(fit, relation, [*names, "current_offset_a"], use)
    if found is None:
        fit.result.missing(names, "no current, load and motion together")
        return
    made, weight, values, covariance = found
    _check_sign(values, "commanded_load" if "commanded_load" in rows.index else LOAD)
    for name, reason in DRIVES.items():
        if name not in values and name not in fit.result.not_identified:
            fit.result.missing([name], reason)
    fit.result.found(possible(values), covariance)
    fit.leave_out(made, weight, use)


def _not_negative(
    fit: RelationFits, relation: str, names: list[str], use: Flags
) -> tuple[Regression, Array, dict[str, float], Array] | None:
    """RelationFits in which no friction is negative beyond its error; one that is counts as 0.

    A mass is taken from the description instead. The others are then fitted anew: they would hold
    what it had taken from them.
    """
    while (made := fit.regression(relation, fit.data.rows.current, names, use)) is not None:
        x, covariance, weight = robust_fit(made.columns, made.target, fit.data.run[use])
        values, covariance = made.solved(x, covariance)
        errors = dict(zip(values, np.sqrt(np.diag(covariance)), strict=True))
        below = {n: values[n] / errors[n] for n in NOT_NEGATIVE if n in values and errors[n] > 0.0}
        least = min(below, key=lambda n: below[n], default="")
        loose = [n for n in DRIVES if n in values and errors[n] * NEGATIVE >= abs(values[n])]
        if loose:
            # What it is known by, the answer of the current, is no more than its error.
            fit.result.missing(loose, "the current does not answer to the load beyond its error")
            names = [name for name in names if name not in loose]
            continue
        if not least or below[least] >= -NEGATIVE:
            return made, weight, values, covariance
        held = fit.relations.described.get(least, 0.0) if least == MASS else 0.0
        fit.result.parameters = replace(fit.result.parameters, **{least: held})
        reason = f"{values[least]:.3g} by the fit, which is none: {held:.4g} taken"
        fit.result.missing([least], reason)
        names = [name for name in names if name != least]
    return None


def _check_sign(values: Mapping[str, float], load: str) -> None:
    for name, unit in zip(DRIVES, ("newton", "watt"), strict=True):
        if values.get(name, 1.0) <= 0.0:
            raise CalibrationError(
                f"the current falls by {-1.0 / values[name]:.2e} A per {unit} of "
                f"opposing load: motor_current or {load} has the wrong sign (positive load opposes "
                "extension)"
            )


def _electrical(fit: RelationFits) -> None:
    own = ("winding_resistance_ohm", "back_emf_v_s_per_m", "voltage_offset_v")
    names = (*own, "drive_drop_v", *fit.further(fit.data.rows.circuit))
    p, result = fit.result.parameters, fit.result
    use = np.ones(len(fit.data.run), dtype=bool)
    voltage = fit.data.rows.voltage
    made = fit.regression(fit.data.rows.circuit, voltage, names, use)
    if made is None:
        result.missing(own, "no motor_voltage channel")
        return
    # Energy conservation: the back-EMF constant equals the force constant. With R given, only
    # the offset is unknown; a median finds it if fewer than half of the samples are bad.
    guess = {names[0]: p.winding_resistance_ohm, names[1]: p.force_constant_n_per_a}
    start = np.array([guess.get(name, 0.0) for name in made.names])
    if names[2] in made.names:
        start[made.names.index(names[2])] = np.median(made.target - made.columns @ start)
    x, weight = fit.take(made, use, start)
    residual = made.target - made.columns @ x
    scale = 1.4826 * float(np.median(np.abs(residual[weight > 0])))
    # No healthy unit deviates by a third of the drive's output range.
    supply_v = float(np.quantile(np.abs(fit.signals[voltage][use]), 0.99))
    result.voltage_limit_v = max(8.0 * scale, supply_v / 3.0)


def _others(fit: RelationFits) -> None:
    """Relations of other kinds, such as the balance of a second moved part."""
    for row in fit.relations.relations:
        names = fit.further(row.name)
        use = np.ones(len(fit.data.run), dtype=bool)
        made = fit.regression(row.name, row.signals[0], names, use) if names else None
        if made is not None:
            fit.take(made, use)
    named = {*further_of(fit.result.parameters)} & set(fit.relations.parameters)
    balanced = {name for row in fit.relations.relations for name in symbols(row.expression)}
    left = sorted((named & balanced) - {*fit.result.sigmas, *fit.result.not_identified})
    fit.result.missing(left, "no relation of these channels fixes it")


def _drive(fit: RelationFits) -> None:
    names = ("drive_gain", "drive_offset_v", "drive_drop_v")
    use = np.ones(len(fit.data.run), dtype=bool)
    pair = {fit.data.rows.voltage, fit.data.rows.command}
    related = (r.name for r in fit.relations.relations if pair <= set(r.signals))
    made = fit.regression(next(related, ""), fit.data.rows.voltage, names, use)
    if made is None:
        fit.result.missing(names, "no commanded_voltage channel")
        return
    fit.take(made, use)


def _position(fit: RelationFits) -> None:
    """Two positions of one part; what lies between them stretches under the load."""
    data, result, name = fit.data, fit.result, "position_offset_m"
    held = [row for row in fit.relations.relations if name in symbols(row.expression)]
    alike = "no more than what units differ by; the description's"
    result.missing(["coupling_play_m", "position_gain"], alike)
    stretch = "coupling_compliance_m_per_n"
    if held and stretch in symbols(held[0].expression):
        use = np.ones(len(data.run), dtype=bool)
        made = fit.regression(held[0].name, data.rows.position, [name, stretch], use)
        if made is not None:
            fit.take(made, use)
        return
    result.missing([stretch], "no load between two positions")
    one, other = held[0].signals if held else ("", "")
    use = data.with_values(one, other)
    if not use.any():
        result.missing([name], "no second position channel")
        return
    apart = (data.column(one) - data.column(other))[use]
    offset, run = float(np.median(apart)), data.run[use]
    each = np.array([np.median(apart[run == number]) for number in np.unique(run)])
    error = float(np.var(each, ddof=1)) / len(each) if len(each) > 1 else float(np.var(apart))
    result.found({name: offset}, np.array([[error]]))
