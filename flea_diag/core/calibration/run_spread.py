"""By how much healthy units differ: tolerances of the description, at calibrated values."""

from __future__ import annotations

from flea_diag.core.bond_graph.tolerance import Tolerance
from flea_diag.core.residuals.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.symbolic.expression import Variable

HEATING = "thermal_rate_k_per_s"
SHARE, NOISES = 0.1, 3.0
"""Of what a description states no tolerance for: share of its value, and multiples of the noise of
the sensor whose offset it is."""


def tolerance_of(parameters: ActuatorParameters, relations: RelationSet) -> UnitTolerance:
    """Differences between healthy units (one sigma), which recordings of one unit do not show."""
    rows, stated = relations.residuals, relations.tolerances
    noises = {offset: rows.noise[channel] for channel, offset in relations.offsets.items()}
    spread = {}
    for name in relations.units:
        noise = noises.get(Variable(name), 0.0)
        tolerance = stated.get(name) or Tolerance(SHARE, NOISES * noise)
        spread[name] = tolerance.of(getattr(parameters, name))
    if HEATING in stated:
        spread[HEATING] = stated[HEATING].of(0.0)
    return UnitTolerance(**spread)
