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

"""Three faults in two relations, for tests of likelihoods."""

from __future__ import annotations

from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from support.models.hand_relations import catalogue_effects, slope_relations
from support.observed import flea_parameters

MECHANICAL, ELECTRICAL, DRIVE = "parity_mechanical", "parity_electrical", "parity_drive"
EFFECTS = catalogue_effects(slope_relations())
"""Of the shipped catalogue on a FLEA without an encoder; its speed is this signal."""
RATE = "d_actuator_position"
BASIS = EFFECTS.basis_of(flea_parameters())
RESIDUALS = (MECHANICAL, ELECTRICAL)
SIGMA = {MECHANICAL: 12.0, ELECTRICAL: 0.6}
SPACING = {MECHANICAL: 4.0, ELECTRICAL: 2.0}
DIFFERING = (10.0, 125.0, 15.0, 0.3, 4.0, 0.5, 0.15)
ALIKE = [1e-6] * (len(UNIT_PARAMETERS) - len(DIFFERING))
TOLERANCE = (*DIFFERING, *ALIKE, 0.03, 0.03, 0.03)
INFINITE = float("inf")
DRAG = FaultModel(
    "drag",
    (Size("coulomb", "N", 0.0, INFINITE), Size("viscous", "N s/m", 0.0, INFINITE)),
    (Term(MECHANICAL, "direction", 1.0, 0), Term(MECHANICAL, RATE, 1.0, 1)),
)
BIAS = FaultModel(
    "bias",
    (Size("bias", "A", -3.0, 3.0),),
    (Term(MECHANICAL, "one", 170.0), Term(ELECTRICAL, "one", -3.0)),
)
LOAD = FaultModel(
    "load",
    (Size("bias", "N", -600.0, 600.0), Size("share", "1", -1.0, 0.5)),
    (Term(MECHANICAL, "one", -1.0), Term(MECHANICAL, "load_force", -1.0, 1)),
)
