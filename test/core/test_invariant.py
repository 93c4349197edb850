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

"""What a verdict rests on is checked where it is decided, with any interpreter options."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support import stands

from flea_diag.core.invariant import distribution, finite, ordered, shaped
from flea_diag.core.isolation.isolation import Isolation
from flea_diag.errors import InvariantError


def fresh() -> Isolation:
    """Every fault of the catalogue."""
    known = stands.knowledge()
    return Isolation(known.faults, known.signatures, known.effects.residuals.symptoms)


@pytest.mark.parametrize("shares", [(0.5, 0.4), (1.1, -0.1), (math.nan, 1.0), (math.inf, 0.0)])
def test_what_is_no_distribution_is_named(shares: tuple[float, ...]) -> None:
    with pytest.raises(InvariantError, match="probabilities"):
        distribution("probabilities", shares)


def test_rounding_is_no_defect() -> None:
    """Ten tenths do not add up to one in binary."""
    distribution("probabilities", [0.1] * 10)
    finite("evidence", [-1e300, 0.0])
    ordered("stamps", 5, 5)
    shaped("columns", np.zeros((2, 3)).shape, (2, 3))


def test_evidence_that_is_no_number_decides_nothing() -> None:
    """The best of a NaN and a number depends on which comes first."""
    isolation = fresh()
    first, second = list(isolation.hypotheses.values())[:2]
    for hypothesis in isolation.hypotheses.values():
        if hypothesis not in (first, second):
            hypothesis.why_dropped = "for the test"
    isolation.normalise()
    assert first.probability == second.probability == 0.5
    second.log_likelihood = math.nan
    with pytest.raises(InvariantError, match="evidence of the hypotheses"):
        isolation.normalise()


def test_a_feature_leaves_probabilities_of_all_that_is_left() -> None:
    """Two faults with half of the probability: whose the other half is nobody says."""
    isolation = fresh()
    isolation.normalise()
    one, other = list(isolation.hypotheses)[:2]
    with pytest.raises(InvariantError, match="after a feature"):
        isolation.update(1, "accelerometer_1_std", "+", {one: 0.25, other: 0.25})


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (lambda: ordered("merge", 7, 6), "merge: stamp 6 ns after 7 ns"),
        (lambda: shaped("regressors", (3, 2), (3, 4)), r"regressors: shape \(3, 2\), not \(3, 4\)"),
        (lambda: finite("evidence", [0.0, math.nan]), "evidence"),
    ],
)
def test_the_words_name_the_thing_and_the_values(check, words: str) -> None:
    with pytest.raises(InvariantError, match=words):
        check()
