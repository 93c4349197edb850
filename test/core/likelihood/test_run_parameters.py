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

"""Values that each run may have of its own: when they are known, and what is none of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.core.likelihood.run_parameters import FreeTerms, RunLearning, RunStage
from flea_diag.core.scan_counts import ScanCounts

COUNTS = ScanCounts(0.01)
STROKE = 150
"""Scans from one reversal to the next."""


def learning(low: float = 0.0, high: float = math.inf) -> RunLearning:
    """Of a weight of 100 N in one relation, beside a dry friction of 10 N within 20 %."""
    terms = FreeTerms(("weight_n",), ("coulomb_friction_n",), ("balance",), (0,), lambda p, x: ())
    return RunLearning(
        terms,
        {"weight_n": 100.0},
        {"weight_n": (low, high)},
        {"coulomb_friction_n": 2.0},
        np.array([4.0]),
        np.array([0.5]),
        8.0,
        COUNTS,
    )


def run(
    learned: RunLearning, scans: int, weight_n: float, drag_n: float = 0.0, start: int = 0
) -> None:
    """Strokes up and down of a machine of this weight and additional drag."""
    noise = np.random.default_rng(3 + start).normal(0.0, 1.0, scans)
    for scan in range(scans):
        way = 1.0 if ((start + scan) // STROKE) % 2 == 0 else -1.0
        # r = force - weight - friction * way, by the weight in use.
        short = learned.values["weight_n"] - weight_n
        value = short - drag_n * way + noise[scan]
        learned.step(True, np.array([value]), np.array([[1.0, way]]), frozen=False)


def rest(learned: RunLearning) -> None:
    for _ in range(COUNTS.of(1.0)):
        learned.step(False, np.array([np.nan]), np.array([[1.0, 1.0]]), frozen=False)


def test_a_weight_is_known_once_the_machine_has_gone_both_ways() -> None:
    learned = learning()
    run(learned, STROKE - 10, 130.0)
    assert learned.waits
    run(learned, 4 * STROKE, 130.0, start=STROKE - 10)
    assert learned.stage is RunStage.KNOWN
    assert learned.values["weight_n"] == pytest.approx(130.0, abs=1.0)
    assert learned.found[0].within


def test_a_drag_from_the_start_is_no_weight() -> None:
    learned = learning()
    run(learned, 6 * STROKE, 100.0, drag_n=25.0)
    assert learned.values["weight_n"] == pytest.approx(100.0, abs=1.0)


def test_another_weight_after_a_rest_is_learned_anew() -> None:
    learned = learning()
    run(learned, 6 * STROKE, 100.0)
    rest(learned)
    run(learned, 50, 140.0)
    assert learned.waits
    run(learned, 6 * STROKE, 140.0, start=50)
    assert learned.values["weight_n"] == pytest.approx(140.0, abs=1.0)


def test_a_drag_after_a_rest_changes_no_weight() -> None:
    learned = learning()
    run(learned, 6 * STROKE, 120.0)
    before = dict(learned.values)
    rest(learned)
    run(learned, 6 * STROKE, 120.0, drag_n=25.0)
    assert not learned.waits
    assert learned.values == before


def test_a_fault_that_begins_while_another_weight_is_learned_is_no_weight() -> None:
    learned = learning()
    run(learned, 6 * STROKE, 120.0)
    before = dict(learned.values)
    rest(learned)
    run(learned, 50, 140.0)
    assert learned.waits
    # A reading that errs from here on, now to one side and now to the other.
    for scan in range(50, 4 * STROKE):
        way = 1.0 if (scan // STROKE) % 2 == 0 else -1.0
        error = 30.0 if (scan // 40) % 2 == 0 else -30.0
        learned.step(True, np.array([error]), np.array([[1.0, way]]), frozen=False)
    assert not learned.waits
    assert learned.values == before


def test_the_same_weight_after_a_rest_is_judged_at_once() -> None:
    learned = learning()
    run(learned, 6 * STROKE, 120.0)
    rest(learned)
    for scan in range(2 * STROKE):
        run(learned, 1, 120.0, start=scan)
        assert not learned.waits


def test_a_value_outside_its_range_is_not_taken() -> None:
    learned = learning(high=150.0)
    run(learned, 6 * STROKE, 200.0)
    assert learned.values["weight_n"] == 100.0
    assert not learned.found[0].within
    assert learned.found[0].value == pytest.approx(200.0, abs=1.0)


def test_nothing_is_learned_within_an_episode() -> None:
    learned = learning()
    for scan in range(6 * STROKE):
        way = 1.0 if (scan // STROKE) % 2 == 0 else -1.0
        learned.step(True, np.array([-30.0]), np.array([[1.0, way]]), frozen=True)
    assert learned.waits
    assert learned.values["weight_n"] == 100.0
