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

"""When a fault is there, moment by moment, in residuals that are made up."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import numpy.typing as npt
import pytest

from flea_diag.core.recurrence.presence import ODD, TURNS_HZ, presence

Array = npt.NDArray[np.float64]

MOMENT_S = 0.02
BOUND, RARE = -math.log(ODD), -math.log(TURNS_HZ * MOMENT_S)


def made(share: Array, strength: float, seed: int = 5) -> tuple[Array, Array]:
    """Errors of two relations of unit noise, and what a fault of this strength adds to the second.

    ``share`` of the fault is there, shape (n,).
    """
    effect = np.zeros((len(share), 2))
    effect[:, 1] = strength
    noise = np.random.default_rng(seed).normal(size=effect.shape)
    return noise + share[:, None] * effect, effect


def test_two_that_come_within_a_window_are_two() -> None:
    share = np.zeros(60)
    share[10:14] = share[18:24] = share[45:50] = 1.0
    told = presence(*made(share, 12.0), MOMENT_S)
    assert told.comings.tolist() == [10, 18, 45]
    np.testing.assert_array_equal(told.there, share > 0.0)
    assert told.shows.all()


def test_where_nothing_would_show_the_state_of_before_goes_on() -> None:
    share = np.zeros(60)
    share[10:40] = 1.0
    errors, effect = made(share, 12.0)
    effect[20:30] = errors[20:30] = 0.0  # the current is none
    told = presence(errors, effect, MOMENT_S)
    assert told.comings.tolist() == [10]
    assert told.there[20:30].all()
    assert np.flatnonzero(~told.shows).tolist() == list(range(20, 30))


def test_one_odd_moment_is_no_turn() -> None:
    share = np.zeros(60)
    share[10:40] = 1.0
    share[25] = 0.0
    share[50] = 1.0
    assert presence(*made(share, 12.0), MOMENT_S).comings.tolist() == [10]


def test_a_weak_fault_is_told_by_many_moments() -> None:
    """None of them shows it by itself."""
    share = np.zeros(400)
    share[150:250] = 1.0
    told = presence(*made(share, 1.0), MOMENT_S)
    assert not told.shows.any()
    assert told.comings.tolist() == [pytest.approx(150, abs=20)]


@pytest.mark.parametrize("seed", range(8))
def test_no_sequence_of_states_has_more_evidence(seed: int) -> None:
    """Against all 2 048 of them."""
    share = np.random.default_rng(seed).integers(0, 2, 11).astype(float)
    errors, effect = made(share, 2.5, seed)
    odds = (effect * errors).sum(axis=1) - 0.5 * np.square(effect).sum(axis=1)
    odds = np.clip(odds, -BOUND, BOUND)

    def evidence(states: Array) -> float:
        turns = np.abs(np.diff(states, prepend=0.0)).sum()
        return float(odds @ states - RARE * turns)

    best = max(evidence(np.array(states, dtype=float)) for states in product((0, 1), repeat=11))
    assert evidence(presence(errors, effect, MOMENT_S).there.astype(float)) == pytest.approx(best)
