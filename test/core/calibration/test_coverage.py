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

"""The limit for a stated coverage, against its definition and against draws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.calibration.out_of_sample import GroupCoverage


@pytest.mark.parametrize(
    ("coverage", "place"),
    [(0.5, 10), (0.9, 18), (0.95, 19), (0.951, math.inf), (0.05, 1)],
    ids=["median", "nine in ten", "as much as 19 runs give", "more than they give", "least"],
)
def test_the_limit_is_the_order_statistic_of_split_conformal_prediction(
    coverage: float, place: float
) -> None:
    """Of 19 scores 1, 2, ..., 19 the ceil(20 coverage)-th."""
    known = GroupCoverage("", tuple(map(float, range(1, 20))))
    assert known.limit_nats(coverage) == place


def test_a_lost_fault_counts_as_beyond_any_limit() -> None:
    known = GroupCoverage("", (1.0, 2.0, 3.0), lost=6)
    assert known.limit_nats(0.3) == 3.0
    assert known.limit_nats(0.31) == math.inf
    assert known.most == 0.3
    assert GroupCoverage("", (), lost=2).limit_nats(0.5) == math.inf


def test_further_runs_are_covered_as_often_as_stated() -> None:
    """1000 calibrations of 99 runs each: exactly 0.9 on average, with a sigma of 0.001."""
    scores = np.sort(np.random.default_rng(5).exponential(size=(1000, 99)), axis=1)
    limits = [GroupCoverage("", tuple(row.tolist())).limit_nats(0.9) for row in scores]
    assert np.mean(-np.expm1(-np.array(limits))) == pytest.approx(0.9, abs=0.004)
