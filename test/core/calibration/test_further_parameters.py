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

"""Parameters that one description alone names: fitted, written, read, sent to processes."""

from __future__ import annotations

import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest
from support.places import ROOT

from flea_diag.configuration.calibrations import load_calibration
from flea_diag.core.calibration.calibration_reader import from_mapping
from flea_diag.core.calibration.relation_fit import regression
from flea_diag.core.residuals.parameters import (
    ActuatorParameters,
    actuator_parameters,
    as_record,
    further_of,
)
from flea_diag.core.residuals.relation_set import CompiledRelation, RelationSet
from flea_diag.core.symbolic.expression import Expression, Variable
from flea_diag.errors import CalibrationError

JOINT = ROOT / "config" / "stands" / "joint" / "calibration.yaml"
RANDOM = np.random.default_rng(8)
SIGNALS = {name: RANDOM.normal(size=300) for name in ("current", "force", "speed")}
CURRENT, FORCE, SPEED = (Variable(name) for name in SIGNALS)
K, ZERO, WEIGHT, B = (Variable(name) for name in ("K", "i0", "weight_n", "B"))


def test_a_calibration_holds_them_and_reads_them_back() -> None:
    known = load_calibration(JOINT)
    wider = actuator_parameters({**asdict(known.parameters), "weight_n": 620.0})
    written = replace(known, parameters=wider).to_mapping()
    assert written["further_parameters"] == {"weight_n": 620.0}
    assert "weight_n" not in written["parameters"]
    assert from_mapping(written, "made").parameters == wider
    assert "further_parameters" not in known.to_mapping()
    with pytest.raises(CalibrationError, match="further_parameters: 'current_offset_a'"):
        from_mapping({**written, "further_parameters": {"current_offset_a": 1.0}}, "made")


def test_they_cross_processes_and_reach_compiled_code() -> None:
    made = actuator_parameters({"weight_n": 3.0, "coulomb_friction_n": 2.0})
    assert isinstance(made, ActuatorParameters)
    assert pickle.loads(pickle.dumps(made)) == made
    assert further_of(replace(made, weight_n=4.0)) == {"weight_n": 4.0}
    assert as_record(made)["weight_n"][0] == 3.0
    assert type(actuator_parameters({"current_offset_a": 1.0})) is ActuatorParameters


def fitted(
    expression: Expression, current: np.ndarray, known: dict[str, float]
) -> dict[str, float]:
    row = CompiledRelation("r", "N", expression, tuple(SIGNALS))
    signals, use = {**SIGNALS, "current": current}, np.ones(300, dtype=bool)
    start = {"K": 100.0, "i0": 0.0, "weight_n": 500.0, "B": 10.0}
    while True:
        made = regression(row, known, "current", signals, use, start, ("i0",))
        loose = made.not_fixed()
        if not loose:
            break
        known |= {name: start[name] for name in loose}
    x = np.linalg.lstsq(made.columns, made.target, rcond=None)[0]
    return made.solved(x, np.eye(len(x)))[0]


def test_a_weight_is_fitted_and_the_zero_that_acts_alike_stays() -> None:
    """K i = F + G + B v: of weight and zero of the current's sensor a recording fixes the sum."""
    current = (SIGNALS["force"] + 620.0 + 30.0 * SIGNALS["speed"]) / 180.0
    found = fitted(K * (CURRENT - ZERO) - FORCE - WEIGHT - B * SPEED, current, {})
    assert found == pytest.approx({"K": 180.0, "weight_n": 620.0, "B": 30.0})


def test_more_quotients_than_parameters_are_fitted_together() -> None:
    """A friction that thins by a share for each kelvin: its two terms hold three parameters."""
    share, dry = Variable("k"), Variable("fc")
    warm = 1 + share * FORCE
    current = (3.0 + 2.0 * SIGNALS["speed"]) * (1 - 0.02 * SIGNALS["force"]) / 5.0
    made = fitted(K * CURRENT - (dry + B * SPEED) * warm, current, {"K": 5.0})
    assert made == pytest.approx({"fc": 3.0, "B": 2.0, "k": -0.02}, rel=1e-6)


def test_a_relation_of_which_every_term_may_differ_leaves_one_to_stand_for_the_scale() -> None:
    """K i - B v with a tolerance for both: the residual itself would be such a difference."""
    force, drag = Variable("force_constant_n_per_a"), Variable("viscous_friction_n_s_per_m")
    row = CompiledRelation("r", "N", force * CURRENT - drag * SPEED, ("current", "speed"))
    units = ("viscous_friction_n_s_per_m", "force_constant_n_per_a")
    stated = dict.fromkeys(units, 0.1)
    made = RelationSet((row,), ("current", "speed"), {}, {}, units, tolerances=stated)  # type: ignore[arg-type]
    assert made.unscaled == {"r": "force_constant_n_per_a"}
    loaded = replace(row, expression=row.expression - FORCE)
    assert not replace(made, relations=(loaded,)).unscaled
