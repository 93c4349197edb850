"""By how much healthy units differ beside what the limits of a calibration hold already.

``UnitTolerance`` states what DC motors with a screw differ by from unit to unit, which recordings
of one unit do not show. A balance of power holds the losses of a drive as well; there the scatter
between recordings, which the limits are made of, is all that is known.
"""

from __future__ import annotations

from dataclasses import replace

from flea_diag.core.residuals.parameters import ActuatorParameters, UnitTolerance
from flea_diag.core.residuals.relation_set import RelationSet

POWER = "power"
SHARE = 0.01
"""Of the value of a parameter; a spread of 0 would make its healthy difference impossible."""
ABSENT = 1e-6


def tolerance_of(parameters: ActuatorParameters, relations: RelationSet) -> UnitTolerance:
    """Differences between healthy units (one sigma): those of DC motors, or next to none."""
    known = UnitTolerance()
    held = relations.named.get(relations.residuals.friction)
    if held is None or held.kind != POWER:
        return known
    values = {n: max(SHARE * abs(getattr(parameters, n)), ABSENT) for n in relations.units}
    return replace(known, **values)
