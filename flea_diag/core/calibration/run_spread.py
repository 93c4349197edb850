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

"""By how much healthy units differ: as the description states it, and as three units or more show.

The variance of a parameter between units is that of the values which each unit's own recordings
give, less the variance of these values' errors (the moment estimate of a random effect). Of k units
it has k - 1 degrees of freedom, so it is joined with the stated tolerance as with ``STATED`` more:

    T^2 = (STATED T_stated^2 + (k - 1) T_measured^2) / (STATED + k - 1)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from flea_diag.core.bond_graph.tolerance import Tolerance
from flea_diag.core.residuals.parameters import (
    LATER_TOLERANCES,
    UNIT_PARAMETERS,
    ZEROS,
    ActuatorParameters,
    UnitSpread,
    UnitTolerance,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import Variable
from flea_diag.errors import CalibrationError

HEATING = "thermal_rate_k_per_s"
SHARE, NOISES = 0.1, 3.0
"""Of what a description states no tolerance for: share of its value, and multiples of the noise of
the sensor whose offset it is."""
LEAST_UNITS = 3
"""With fewer units of known serial number, recordings are left out one by one."""
ALIKE = 0.3
"""Units that differ by less than this share of the stated tolerance in every parameter are one."""
STATED = 2.0
"""Degrees of freedom that a stated tolerance counts as: as many as three units have."""

OwnFit = Mapping[str, tuple[float, float]]
"""Parameter -> its value by the recordings of one unit, and the standard error of that."""


def tolerance_of(parameters: ActuatorParameters, relations: RelationSet) -> UnitTolerance:
    """Differences between healthy units (one sigma), which recordings of one unit do not show.

    Raises
    ------
    CalibrationError
        The description predicts a temperature, and does not say how far its rate may be off.
    """
    rows, stated = relations.residuals, relations.tolerances
    noises = {offset: rows.noise[channel] for channel, offset in relations.offsets.items()}
    if relations.predictions and HEATING not in stated:
        names = ", ".join(row.name for row in relations.predictions)
        raise CalibrationError(
            f"the description predicts {names} and states no tolerance {HEATING}, by which the "
            "heating of a healthy unit departs from that: add it under tolerances"
        )
    spread = {HEATING: stated.get(HEATING, Tolerance()).of(0.0)}
    for name in relations.units:
        if name in LATER_TOLERANCES and name not in stated:
            continue
        noise = noises.get(Variable(name), 0.0)
        tolerance = stated.get(name) or Tolerance(SHARE, NOISES * noise)
        spread[name] = tolerance.of(getattr(parameters, name))
    return UnitTolerance(**spread)


def measured_spread(units: Sequence[OwnFit], stated: UnitTolerance) -> UnitSpread:
    """Spread between units of each parameter that every unit's own recordings fix.

    They fix it where the errors of the units' values are below the stated tolerance.
    """
    if len(units) < LEAST_UNITS:
        return UnitSpread()
    found = {}
    for name in UNIT_PARAMETERS:
        known = [unit[name] for unit in units if name in unit]
        if len(known) < len(units):
            continue
        values, errors = np.array(known).T
        error = float(np.mean(np.square(errors)))
        if error < getattr(stated, name) ** 2:
            found[name] = math.sqrt(max(float(np.var(values, ddof=1)) - error, 0.0))
    return UnitSpread(len(units), found)


def recorded_spread(sigmas: Mapping[str, float], recordings: int) -> UnitSpread:
    """Spread of the parameters between the recordings of one unit, by the errors of their mean."""
    known = {name: sigma for name, sigma in sigmas.items() if name in UNIT_PARAMETERS}
    return UnitSpread(1, {name: sigma * math.sqrt(recordings) for name, sigma in known.items()})


def are_one(measured: UnitSpread, stated: UnitTolerance) -> bool:
    """Whether units of different serial numbers are alike, as no units of a design are."""
    apart = [
        spread / getattr(stated, name)
        for name, spread in measured.spread.items()
        if name not in ZEROS
    ]
    return measured.count >= LEAST_UNITS and bool(apart) and max(apart) < ALIKE


def joined(stated: UnitTolerance, measured: UnitSpread) -> UnitTolerance:
    """The stated tolerance, corrected by what units have shown."""
    if measured.count < LEAST_UNITS:
        return stated
    freedom = measured.count - 1
    tolerances = {
        name: math.sqrt(
            (STATED * getattr(stated, name) ** 2 + freedom * spread**2) / (STATED + freedom)
        )
        for name, spread in measured.spread.items()
    }
    return replace(stated, **tolerances)
