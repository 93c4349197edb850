"""Regression on a relation: columns by differentiation, parameters from quotients."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.calibration.relation_fit import regression
from flea_diag.core.residuals.relation_set import CompiledRelation
from flea_diag.core.symbolic.expression import Expression, Variable, apply

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
