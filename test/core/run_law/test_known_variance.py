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

"""What a claim is held against: as wide as Student's distribution, as far as recordings show it."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.run_law.known_variance import CLAIM_NATS, KnownVariance
from flea_diag.core.run_law.variance_prior import VariancePrior

FLAT = VariancePrior(np.array([100.0]), np.array([False]))
"""So broad that a variance of 1 is found by the recordings alone."""


def shown(squares, prior=FLAT, information=1e8) -> KnownVariance:
    """Recordings that tell their coefficient all but exactly."""
    column = np.array(squares, dtype=float)[:, None]
    return KnownVariance(column * information, np.full(column.shape, information), prior)


@pytest.mark.parametrize("runs", [6, 12, 30, 100])
def test_of_like_recordings_a_claim_is_held_against_the_distribution_of_student(runs):
    # A flat prior of the standard deviation takes one recording.
    freedom = runs - 1.0
    known = shown(np.full(runs, freedom / runs))
    expected = freedom * np.expm1(2.0 * CLAIM_NATS / (freedom + 1.0)) / (2.0 * CLAIM_NATS)
    assert known.wide()[0] == pytest.approx(expected, rel=0.2)


def test_more_recordings_bring_it_down_to_the_variance_itself():
    wide = [shown(np.ones(runs)).wide()[0] for runs in (4, 8, 16, 1000)]
    assert sorted(wide, reverse=True) == wide
    assert wide[-1] == pytest.approx(1.0, rel=0.15)


def test_what_no_other_recording_shows_is_as_wide_as_its_prior_lets_it_be():
    both = VariancePrior(np.array([4.0, 4.0]), np.array([False, True]))
    none = KnownVariance(np.zeros((5, 2)), np.zeros((5, 2)), both)
    assert none.likely() == pytest.approx([4.0, 4.0], rel=0.1)
    stated, guessed = none.wide()
    # S (1 - S / (2 A^2 L)) is largest at L A^2.
    assert stated == pytest.approx(4.0 * CLAIM_NATS / 2.0, rel=0.05)
    assert guessed > 50.0 * stated


def test_a_recording_that_alone_shows_a_column_is_judged_by_the_prior():
    """What it is off by itself neither widens nor narrows what it is held against."""
    prior = VariancePrior(np.array([1.0]), np.array([False]))
    alone = KnownVariance(np.array([[900.0], [0.0]]), np.array([[1.0], [0.0]]), prior)
    assert alone.wide(0) == pytest.approx(CLAIM_NATS / 2.0, rel=0.05)
    assert alone.wide()[0] > 5.0 * alone.wide(0)[0]


def test_a_variance_that_recordings_cannot_tell_from_their_noise_is_no_wider_than_that():
    rng = np.random.default_rng(1)
    known = KnownVariance(np.square(rng.standard_normal((40, 1))), np.ones((40, 1)), FLAT)
    assert known.wide()[0] < 3.0


def test_estimates_after_the_recordings_give_back_what_they_were_made_of():
    coefficient, error, variance = 3.0, 0.5, 2.0
    kept = 1.0 / (1.0 / error + 1.0 / variance)
    apart = coefficient * kept / error
    known = KnownVariance.of(np.array([[apart]]), np.array([[kept]]), np.array([variance]), FLAT)
    assert known.information[0, 0] == pytest.approx(1.0 / error)
    assert known.square[0, 0] == pytest.approx(coefficient**2 / error)
