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

"""Systems side by side have the bits of each alone, and keep their bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from flea_diag.core.likelihood import bounded_systems
from flea_diag.core.likelihood.bounded_systems import BoundedSystems
from flea_diag.core.likelihood.fault_models import FaultModel, Size

UNKNOWNS = 6


def model(*bounds: tuple[float, float]) -> FaultModel:
    return FaultModel("fault", tuple(Size("size", "", low, high) for low, high in bounds), ())


WIDE, NARROW = (-1e9, 1e9), (0.0, 0.01)
MODELS = (model(WIDE, WIDE), model(NARROW, WIDE), model(NARROW, NARROW), model(WIDE, NARROW))
PLACES = [0, 1, 1, 2]


def equations(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Three systems, in units as far apart as those of a stand."""
    draw = np.random.default_rng(seed)
    made = draw.standard_normal((3, 40, UNKNOWNS)) * 10.0 ** draw.integers(-3, 4, UNKNOWNS)
    seen = draw.standard_normal((3, 40))
    return np.matmul(made.transpose(0, 2, 1), made), np.matmul(seen[:, None], made)[:, 0]


@pytest.mark.parametrize("seed", range(20))
def test_side_by_side_and_alone_are_the_same_bits(seed: int) -> None:
    A, b = equations(seed)
    every = BoundedSystems(MODELS, PLACES, A, b, 2)
    errors = every.errors(range(len(MODELS)))
    for k, (one, own) in enumerate(zip(MODELS, PLACES, strict=True)):
        alone = BoundedSystems((one,), [0], A[own : own + 1], b[own : own + 1], 2)
        assert every.solutions[k].tobytes() == alone.solutions[0].tobytes()
        assert errors[k].tobytes() == alone.errors([0])[0].tobytes()
        assert every.misfit(k, 40.0) == alone.misfit(0, 40.0)
        assert all(s.low <= x <= s.high for s, x in zip(one.sizes, every.sizes(k), strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_free_sizes_are_those_of_least_squares(seed: int) -> None:
    A, b = equations(seed)
    found = BoundedSystems(MODELS[:1], [0], A, b, 2)
    scale = np.sqrt(np.diagonal(A[0]))
    root = np.linalg.cholesky(A[0] / scale / scale[:, None]).T
    target = np.linalg.solve(root.T, b[0] / scale)
    expected = lsq_linear(root, target).x / scale
    np.testing.assert_allclose(found.solutions[0], expected, rtol=1e-6)
    np.testing.assert_allclose(
        found.errors([0])[0], np.sqrt(np.diagonal(np.linalg.inv(A[0])))[:2], rtol=1e-6
    )


def test_models_of_one_system_and_one_set_of_bounds_are_solved_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    A, b = equations(0)
    solved: list[int] = []
    least = bounded_systems._least

    def counted(of: np.ndarray, right: np.ndarray) -> np.ndarray:
        solved.append(len(right))
        return least(of, right)

    monkeypatch.setattr(bounded_systems, "_least", counted)
    alone = BoundedSystems((model(NARROW, NARROW),), [0], A[:1], b[:1], 2)
    expected = alone.solutions[0]
    needed = len(solved)
    assert needed > 1
    solved.clear()
    twice = BoundedSystems((model(NARROW, NARROW),) * 2, [0, 0], A[:1], b[:1], 2).solutions
    assert len(solved) == needed
    assert [row.tobytes() for row in twice] == [expected.tobytes()] * 2
