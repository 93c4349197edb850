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

"""Smallest sizes of faults against closed forms: one residual, and two that share a bias."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.likelihood.basis import Basis
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.core.likelihood.size_bound import LikelihoodOf, SizeBound, size_bounds

COUNT, SIGMA, EXPLAIN, DROP = 400, 0.5, 3.0, 3.5
BASIS = Basis(("one",))
WITHIN = 2.0 ** (1.0 / 16.0)
"""Resolution of four bisections of a factor of two."""


def model(fault: str, *residuals: str, high: float = math.inf) -> FaultModel:
    """A bias of these residuals."""
    terms = tuple(Term(name, "one", 1.0) for name in residuals)
    return FaultModel(fault, (Size("bias", "V", 0.0, high),), terms)


def bounds(*models: FaultModel, formed: int = COUNT) -> dict[str, SizeBound]:
    values = np.zeros((COUNT, 2))
    values[formed:] = np.nan
    evidence = NormalEquations(("a", "b"), BASIS)
    evidence.add(values, np.ones((COUNT, 1)))
    both, one = dict.fromkeys("ab", SIGMA), dict.fromkeys("ab", 1.0)
    tolerance = (1.0,) * len(BASIS.differences)
    test = LikelihoodOf(models, both, one, tolerance, EXPLAIN, DROP)
    names = [model.fault for model in models]
    return {row.fault: row for row in size_bounds(evidence, evidence, test, names)}


def test_a_bias_is_detected_where_its_likelihood_exceeds_what_a_size_costs() -> None:
    """That is n s^2 / (2 sigma^2) - ln(n) / 2 = nats."""
    found = bounds(model("bias", "a"))["bias"]
    exact = SIGMA * math.sqrt((2.0 * EXPLAIN + math.log(COUNT)) / COUNT)
    assert exact <= found.detected_from <= exact * WITHIN
    assert found.group == ("bias",)
    assert found.isolated_from == found.detected_from


def test_a_bias_of_one_is_isolated_where_that_of_both_falls_behind() -> None:
    """Half of it in both residuals leaves n s^2 / (4 sigma^2) more than the truth."""
    found = bounds(model("one", "a"), model("both", "a", "b"))
    exact = SIGMA * math.sqrt(4.0 * DROP / COUNT)
    assert exact <= found["one"].isolated_from <= exact * WITHIN
    assert found["one"].detected_from < found["one"].isolated_from
    assert found["one"].group == ("one",)


def test_faults_of_one_effect_stay_a_group() -> None:
    found = bounds(model("one", "a"), model("other", "a"))
    assert set(found["one"].group) == {"one", "other"}


@pytest.mark.parametrize(
    ("made", "formed"),
    [
        (model("small", "a", high=0.01), COUNT),
        (model("smaller", "a", high=1e-4), COUNT),
        (model("gone", "a"), 0),
    ],
)
def test_what_cannot_be_seen_is_detected_at_no_size(made: FaultModel, formed: int) -> None:
    (found,) = bounds(made, formed=formed).values()
    assert math.isinf(found.detected_from)
    assert found.group == ()
