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

"""Copies against the weights they come from, by worked examples and over all uniform numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from flea_diag.core.observers.gaussian import square_root
from flea_diag.core.observers.normal_table import RandomBits, normal_numbers, table
from flea_diag.core.observers.resampling import (
    effective_sample_size,
    normalised,
    systematic,
)
from flea_diag.errors import ConfigurationError

GRID = (np.arange(400) + 0.5) / 400
"""Uniform numbers that stand for all of [0, 1)."""

weight_lists = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40).filter(
    lambda row: sum(row) > 1e-3
)


def counts(weights: np.ndarray) -> np.ndarray:
    """Copies of each particle for every number of the grid, shape (grid, N)."""
    n = len(weights)
    return np.array([np.bincount(systematic(weights, u), minlength=n) for u in GRID])


@pytest.mark.parametrize(
    ("weights", "uniform", "wanted"),
    [
        # N w = 0.4, 0.8, 1.2, 1.6; points at u, 1 + u, 2 + u, 3 + u; sums 0.4, 1.2, 2.4, 4.
        ([0.1, 0.2, 0.3, 0.4], 0.0, [0, 1, 2, 3]),
        ([0.1, 0.2, 0.3, 0.4], 0.5, [1, 2, 3, 3]),
        ([0.1, 0.2, 0.3, 0.4], 0.3, [0, 2, 2, 3]),
        ([0.25] * 4, 0.7, [0, 1, 2, 3]),
        ([0.0, 1.0, 0.0], 0.9, [1, 1, 1]),
        ([1.0], 0.0, [0]),
    ],
)
def test_worked_examples(weights: list[float], uniform: float, wanted: list[int]) -> None:
    assert systematic(np.array(weights), uniform).tolist() == wanted


@settings(max_examples=40, deadline=None)
@given(weight_lists)
def test_mean_copies_are_n_times_the_weight(row: list[float]) -> None:
    weights = np.array(row) / sum(row)
    copies = counts(weights)
    assert (copies.sum(axis=1) == len(weights)).all()
    # The grid itself is off by up to one of its 400 steps at either end of a stretch.
    np.testing.assert_allclose(copies.mean(axis=0), len(weights) * weights, atol=2.1 / 400)


@settings(max_examples=40, deadline=None)
@given(weight_lists)
def test_no_particle_is_a_whole_copy_off(row: list[float]) -> None:
    weights = np.array(row) / sum(row)
    expected = len(weights) * weights
    assert (np.abs(counts(weights) - expected) < 1.0 + 1e-9).all()


@settings(max_examples=40, deadline=None)
@given(weight_lists)
def test_copies_vary_no_more_than_multinomial(row: list[float]) -> None:
    weights = np.array(row) / sum(row)
    multinomial = len(weights) * weights * (1.0 - weights)
    assert (counts(weights).var(axis=0) <= multinomial + 3.0 / 400).all()


def test_logarithms_of_any_size_resample_alike() -> None:
    log_weights = np.log([0.1, 0.2, 0.3, 0.4]) - 1e5
    drawn = np.random.default_rng(3)
    total = np.zeros(4)
    for _ in range(2000):
        total += np.bincount(systematic(normalised(log_weights)[0], drawn.random()), minlength=4)
    # Standard error of each mean is below 0.5 / sqrt(2000).
    np.testing.assert_allclose(total / 2000, [0.4, 0.8, 1.2, 1.6], atol=0.045)


def test_normalised_weights_and_their_sum() -> None:
    weights, log_sum = normalised(np.log([1.0, 3.0]) + 700.0)
    np.testing.assert_allclose(weights, [0.25, 0.75])
    assert log_sum == pytest.approx(700.0 + np.log(4.0))


def test_a_particle_that_is_no_number_has_no_weight() -> None:
    weights, _ = normalised(np.array([0.0, np.nan, 0.0, -np.inf]))
    np.testing.assert_array_equal(weights, [0.5, 0.0, 0.5, 0.0])


@pytest.mark.parametrize("bad", [-np.inf, np.nan])
def test_without_any_weight_all_are_alike(bad: float) -> None:
    weights, log_sum = normalised(np.full(4, bad))
    np.testing.assert_array_equal(weights, 0.25)
    assert log_sum == -np.inf


@pytest.mark.parametrize(
    ("weights", "wanted"),
    [([0.25] * 4, 4.0), ([1.0, 0.0, 0.0], 1.0), ([0.5, 0.5, 0.0, 0.0], 2.0)],
)
def test_effective_sample_size(weights: list[float], wanted: float) -> None:
    assert effective_sample_size(np.array(weights)) == pytest.approx(wanted)


def test_table_is_the_normal_distribution() -> None:
    values = table()
    assert values.mean() == pytest.approx(0.0, abs=1e-12)
    assert values.var() == pytest.approx(1.0, abs=1e-12)
    assert stats.kurtosis(values) == pytest.approx(0.0, abs=0.05)
    assert stats.kstest(values, "norm").statistic < 1e-3


def test_random_bits_are_normal_uniform_and_the_generators_own() -> None:
    bits = RandomBits(np.random.default_rng(5), 1000)
    uniform, chosen = zip(*(bits.next() for _ in range(50)), strict=True)
    normal = np.concatenate([normal_numbers(row, table(), (1, 1000))[0] for row in chosen])
    assert stats.kstest(normal, "norm").pvalue > 0.01
    assert abs(np.corrcoef(normal[:-1], normal[1:])[0, 1]) < 0.015
    assert stats.kstest(uniform, "uniform").pvalue > 0.01
    again = RandomBits(np.random.default_rng(5), 1000).next()
    assert again[0] == uniform[0]
    np.testing.assert_array_equal(again[1], chosen[0])


def test_generator_of_32_bits_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="MT19937"):
        RandomBits(np.random.Generator(np.random.MT19937(0)), 4)


@settings(deadline=None)
@given(st.integers(1, 6), st.integers(0, 6), st.integers(0, 1000))
def test_square_root_of_a_covariance_of_any_rank(n: int, rank: int, seed: int) -> None:
    factor = np.random.default_rng(seed).normal(size=(n, min(rank, n)))
    root = square_root(factor @ factor.T)
    np.testing.assert_allclose(root @ root.T, factor @ factor.T, atol=1e-9)
    assert root.shape[1] <= n
