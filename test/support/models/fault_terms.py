"""Three faults in two relations, for tests of likelihoods."""

from __future__ import annotations

from flea_diag.core.likelihood.fault_models import (
    ELECTRICAL,
    MECHANICAL,
    FaultModel,
    Size,
    Term,
)

RESIDUALS = (MECHANICAL, ELECTRICAL)
SIGMA = {MECHANICAL: 12.0, ELECTRICAL: 0.6}
SPACING = {MECHANICAL: 4.0, ELECTRICAL: 2.0}
TOLERANCE = (10.0, 125.0, 15.0, 0.3, 4.0, 0.5, 0.15, 0.03, 0.03, 0.03)
INFINITE = float("inf")
DRAG = FaultModel(
    "drag",
    (Size("coulomb", "N", 0.0, INFINITE), Size("viscous", "N s/m", 0.0, INFINITE)),
    (Term(MECHANICAL, "direction", 1.0, 0), Term(MECHANICAL, "speed_m_s", 1.0, 1)),
)
BIAS = FaultModel(
    "bias",
    (Size("bias", "A", -3.0, 3.0),),
    (Term(MECHANICAL, "one", 170.0), Term(ELECTRICAL, "one", -3.0)),
)
LOAD = FaultModel(
    "load",
    (Size("bias", "N", -600.0, 600.0), Size("share", "1", -1.0, 0.5)),
    (Term(MECHANICAL, "one", -1.0), Term(MECHANICAL, "load_n", -1.0, 1)),
)
