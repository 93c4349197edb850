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

"""Leverage of operating points, against the textbook and a grid of loads and speeds."""

from __future__ import annotations

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema
from support.observed import FLEA_COUNTS

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.residuals.leverage import (
    PLACE,
    CalibrationEnvelope,
    LeverageBasis,
    LeverageFit,
    leverage_root,
    leverages,
)
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual_bank import ResidualBank


def test_leverage_is_that_of_the_hat_matrix_over_its_mean() -> None:
    psi = np.random.default_rng(1).standard_normal((500, 4)) * [1.0, 100.0, 1e-3, 5.0]
    h = leverages(psi, leverage_root(psi), (0,))[:, 0]
    hat = np.einsum("ij,jk,ik->i", psi, np.linalg.inv(psi.T @ psi), psi)
    np.testing.assert_allclose(h, hat * len(psi) / 4, rtol=1e-9)
    assert h.mean() == pytest.approx(1.0)


def test_one_row_has_the_bits_of_many() -> None:
    psi = np.random.default_rng(2).standard_normal((50, 12))
    root = leverage_root(psi)
    assert [leverages(row[None], root, (0, 5))[0].tolist() for row in psi] == (
        leverages(psi, root, (0, 5)).tolist()
    )


def test_a_direction_that_never_varied_is_far_away_once_it_does() -> None:
    psi = np.ones((100, 2))
    psi[:, 1] = np.linspace(-1.0, 1.0, 100)
    both = np.concatenate((psi, np.zeros((100, 1))), axis=1)
    root = leverage_root(both)
    assert leverages(np.array([[1.0, 0.0, 1.0]]), root, (0,))[0, 0] > 100.0


@pytest.mark.parametrize("loads", [1, 2])
def test_loads_have_their_leverage_without_the_position(loads: int) -> None:
    draw = np.random.default_rng(4)
    force = draw.standard_normal((400, loads)) @ draw.standard_normal((loads, loads)) * 300.0 + 50.0
    x = draw.uniform(0.01, 0.09, (400, 1))
    both = np.concatenate((np.ones((400, 1)), force), axis=1)
    psi = np.concatenate((both, x * both), axis=1)
    fit = LeverageFit(PLACE, tuple(map(tuple, leverage_root(psi).tolist())), 1.0, 1.0)
    metric = CalibrationEnvelope("x", (fit,)).load_metric
    found = np.square((force - force.mean(axis=0)) @ metric).sum(axis=1)
    # The intercept has 1 / (1 + loads) of it everywhere.
    alone = leverages(both, leverage_root(both), (0,))[:, 0] - 1.0 / (1 + loads)
    assert found == pytest.approx(alone, rel=1e-6)


def test_without_a_place_there_is_no_metric_of_loads() -> None:
    assert CalibrationEnvelope("x", ()).load_metric.shape == (0, 0)


def test_the_response_of_a_relation_is_none_of_its_regressors() -> None:
    basis = LeverageBasis(_relations())
    assert "motor_current" not in basis.names["parity_mechanical"]
    assert {"load_force", "1"} <= set(basis.names["parity_mechanical"])
    assert "motor_voltage" not in basis.names["parity_electrical"]


def _relations() -> RelationSet:
    return compiled_relations("actuator.yaml", ema.STAND, False)


def test_more_load_than_seen_has_more_leverage_and_a_drag_has_none() -> None:
    """A drag takes current at the same speed, load and position: it is at the same place."""
    relations, basis = _relations(), LeverageBasis(_relations())
    place = list(basis.names).index("parity_mechanical")
    columns = slice(basis.starts[place], (*basis.starts, basis.width)[place + 1])

    def psi(actuator: ema.Actuator, load: float) -> np.ndarray:
        rows = ema.rows(ema.run(actuator, 8.0, load=lambda _: load), ema.STAND)
        bank = ResidualBank(
            stands.calibration().parameters, relations, period_s=0.01, counts=FLEA_COUNTS
        )
        signals = bank.step(rows, frozen=False).signals
        return basis.rows(signals, np.full(len(rows), 0.03))[100:, columns]

    seen = np.concatenate([psi(ema.HEALTHY, load) for load in (-150.0, 0.0, 150.0)])
    root = leverage_root(seen)
    most = leverages(seen, root, (0,)).max()
    beyond = np.median(leverages(psi(ema.HEALTHY, 600.0), root, (0,)))
    dragging = np.median(leverages(psi(ema.changed(coulomb=200.0), 150.0), root, (0,)))
    assert beyond > most
    assert dragging < most
