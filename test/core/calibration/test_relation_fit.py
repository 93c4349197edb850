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

"""Regression on a relation: columns by differentiation, parameters from quotients."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.calibration.relation_fit import regression
from flea_diag.core.residuals.relation_set import CompiledRelation
from flea_diag.core.symbolic.expression import Expression, Variable, apply
from flea_diag.errors import CalibrationError

N = 400
RANDOM = np.random.default_rng(4)
SIGNALS = {name: RANDOM.normal(size=N) for name in ("current", "force", "speed", "volt")}
USE = SIGNALS["speed"] > -1.0
K, OFFSET, DRY, LEAD = (Variable(name) for name in ("K", "i0", "fc", "lead"))
CURRENT, FORCE, SPEED, VOLT = (Variable(name) for name in SIGNALS)


def relation(expression: Expression) -> CompiledRelation:
    return CompiledRelation("r", "N", expression, tuple(SIGNALS))


def solution(columns: np.ndarray, target: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(columns, target, rcond=None)[0]


def test_a_relation_that_is_linear_in_its_parameters_is_fitted_for_them() -> None:
    made = relation(VOLT - OFFSET - K * LEAD * SPEED)
    true = 0.4 + 2.5 * 0.1 * SIGNALS["speed"]
    signals = {**SIGNALS, "volt": true}
    found = regression(made, {"lead": 0.1}, "volt", signals, USE)
    assert len(found.target) == USE.sum()
    values, covariance = found.solved(solution(found.columns, found.target), np.eye(2))
    assert values == pytest.approx({"i0": 0.4, "K": 2.5})
    np.testing.assert_array_equal(covariance, np.eye(2))


def test_a_product_of_parameters_is_found_by_quotients() -> None:
    """K (i - i0) = F + fc |v|: the current is regressed, K is one over the load's column."""
    made = relation(K * (CURRENT - OFFSET) - FORCE - DRY * apply("fabs", SPEED))
    current = -0.3 + (SIGNALS["force"] + 12.0 * np.abs(SIGNALS["speed"])) / 170.0
    found = regression(made, {}, "current", {**SIGNALS, "current": current}, USE)
    values, _ = found.solved(solution(found.columns, found.target), np.eye(3))
    assert values == pytest.approx({"K": 170.0, "i0": -0.3, "fc": 12.0})


def test_without_a_force_of_known_size_the_scale_is_open_and_the_rest_follows_from_it() -> None:
    """K (i - i0) = fc |v| + B v: every force could be twice as large."""
    other = Variable("B")
    made = relation(K * (CURRENT - OFFSET) - DRY * apply("fabs", SPEED) - other * SPEED)
    speed = SIGNALS["speed"]
    current = -0.3 + (12.0 * np.abs(speed) + 5.0 * speed) / 170.0
    signals = {**SIGNALS, "current": current}
    assert regression(made, {}, "current", signals, USE).not_fixed() == ("K",)
    found = regression(made, {"K": 170.0}, "current", signals, USE)
    assert found.not_fixed() == ()
    values, _ = found.solved(solution(found.columns, found.target), np.eye(3))
    assert values == pytest.approx({"i0": -0.3, "fc": 12.0, "B": 5.0})


def test_covariances_follow_the_parameters() -> None:
    """Of 1/x a standard error of s is s / x^2."""
    made = relation(K * (CURRENT - OFFSET) - FORCE)
    found = regression(made, {}, "current", SIGNALS, USE)
    x = np.array([{"x_0": 0.5, "x_1": 0.02}[name] for name in found.names])
    load = found.names.index("x_1")
    sigma = np.zeros((2, 2))
    sigma[load, load] = 1e-6**2
    values, covariance = found.solved(x, sigma)
    place = list(values).index("K")
    assert values["K"] == pytest.approx(50.0)
    assert covariance[place, place] ** 0.5 == pytest.approx(1e-6 / 0.02**2)


def test_what_columns_do_not_fix_is_named() -> None:
    """A load of constant size: friction that grows with it is friction."""
    share = Variable("c")
    dry = (DRY + share * apply("fabs", FORCE)) * SPEED
    made = relation(K * (CURRENT - OFFSET) - FORCE - dry)
    signals = {**SIGNALS, "force": np.where(SIGNALS["volt"] > 0.0, 40.0, -40.0)}
    found = regression(made, {}, "current", signals, USE)
    (loose,) = found.not_fixed()
    assert loose in ("c", "fc")
    again = regression(made, {loose: 0.0}, "current", signals, USE)
    assert again.not_fixed() == ()
    assert set(again.parameters) == {"K", "i0", "c", "fc"} - {loose}


def test_a_known_share_of_the_load_stands_with_the_load() -> None:
    share = Variable("c")
    made = relation(K * (CURRENT - OFFSET) - FORCE - share * apply("fabs", FORCE) * SPEED)
    pressed = SIGNALS["force"] + 0.2 * np.abs(SIGNALS["force"]) * SIGNALS["speed"]
    signals = {**SIGNALS, "current": 0.1 + pressed / 170.0}
    found = regression(made, {"c": 0.2}, "current", signals, USE)
    values, _ = found.solved(solution(found.columns, found.target), np.eye(2))
    assert values == pytest.approx({"K": 170.0, "i0": 0.1})


def test_a_load_that_is_never_there_is_refused() -> None:
    made = relation(K * (CURRENT - OFFSET) - FORCE - DRY * SPEED)
    found = regression(made, {}, "current", {**SIGNALS, "force": np.zeros(N)}, USE)
    with pytest.raises(CalibrationError, match=r"do not fix K: .* under different loads"):
        found.not_fixed()
