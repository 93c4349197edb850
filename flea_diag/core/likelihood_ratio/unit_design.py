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

"""What healthy units differ by, as factors of the basis signals, for one tolerance of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np
import numpy.typing as npt

from flea_diag.core.likelihood.basis import UnitTerm
from flea_diag.core.likelihood.effect_set import EffectSet, name_of
from flea_diag.core.likelihood.effects import EffectRules
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS, ActuatorParameters
from flea_diag.core.symbolic.expression import Constant, evaluate

Array = npt.NDArray[np.float64]


def unit_design(
    effects: EffectSet,
    parameters: ActuatorParameters,
    tolerance: Mapping[str, float],
    residuals: Sequence[str],
) -> Array:
    """Shape (residuals, signals, differences).

    Every parameter that units differ in, the zeros of sensors among them, and how parts heat up;
    ``tolerance`` by ``effects.differences``. Terms in signals that no fault has are left out.
    """
    differences = effects.differences
    rows = {name: row for row, name in enumerate(residuals)}
    columns = {name: column for column, name in enumerate(effects.names)}
    made = np.zeros((len(residuals), len(columns), len(differences)))
    for term in (*_of_parameters(effects, parameters), *_of_heating(effects, parameters)):
        if term.residual in rows and term.regressor in columns:
            place = rows[term.residual], columns[term.regressor], differences.index(term.difference)
            made[place] += term.gain * tolerance[term.difference]
    return made


def _of_parameters(effects: EffectSet, parameters: ActuatorParameters) -> Iterator[UnitTerm]:
    rules, values = EffectRules(effects.relations), asdict(parameters)
    for name in UNIT_PARAMETERS:
        for effect in rules.moved({name: Constant(-1.0)}):
            gain = float(evaluate(effect.gain, values))
            yield UnitTerm(effect.residual, name, name_of(effect.basis), gain)


def _of_heating(effects: EffectSet, parameters: ActuatorParameters) -> Iterator[UnitTerm]:
    terms = effects.basis_of(parameters).unit_terms
    return (term for term in terms if term.difference not in UNIT_PARAMETERS)
