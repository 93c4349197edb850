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

"""Variances between recordings, and densities in closed form, against dense Gaussians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from flea_diag.core.run_law.restricted_likelihood import Spread, run_variance
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.unit_levels import UnitLevels
from flea_diag.core.run_law.variance_prior import VariancePrior

NOISE = 0.3


def prior_of(scale) -> VariancePrior:
    """Of two columns, of which the second is a guess."""
    return VariancePrior(np.full(2, scale, dtype=float), np.array([False, True]))


def drawn(rng: np.random.Generator, mean, sigma, count: int, rows: int = 40):
    """Designs, data and sums of recordings with white noise."""
    made = []
    for _ in range(count):
        x = rng.standard_normal((rows, 2))
        y = x @ (mean + sigma * rng.standard_normal(2)) + NOISE * rng.standard_normal(rows)
        made.append((x, y))
    return made, RunSums.stacked(sums_of(x, y) for x, y in made)


def sums_of(x, y) -> RunSums:
    x, y = x / NOISE, y / NOISE
    scales = np.asarray(-len(y) * np.log(NOISE))
    return RunSums(x.T @ x, x.T @ y, y @ y, np.asarray(float(len(y))), scales)


def test_the_density_of_a_recording_is_that_of_the_whole_gaussian():
    rng = np.random.default_rng(1)
    law = Spread(np.array([0.4, -1.0]), np.array([0.5, 0.0]), np.diag([0.1, 0.2]))
    made, sums = drawn(rng, 0.0, 1.0, 3)
    for k, (x, y) in enumerate(made):
        total = np.diag(law.variance) + law.covariance
        dense = multivariate_normal(x @ law.mean, x @ total @ x.T + NOISE**2 * np.eye(len(y)))
        nats = law.log_density(sums[k]) - 0.5 * len(y) * np.log(2.0 * np.pi)
        assert nats == pytest.approx(dense.logpdf(y), rel=1e-9)


def test_the_posterior_of_a_recording_is_the_ridge_solution():
    rng = np.random.default_rng(2)
    law = Spread(np.array([0.4, -1.0]), np.array([0.5, 0.2]), np.zeros((2, 2)))
    ((x, y),), sums = drawn(rng, 0.0, 1.0, 1)
    off, covariance = law.posterior(sums[0])
    inner = x.T @ x / NOISE**2 + np.diag(1.0 / law.variance)
    assert covariance == pytest.approx(np.linalg.inv(inner))
    assert off == pytest.approx(np.linalg.solve(inner, x.T @ (y - x @ law.mean) / NOISE**2))


@pytest.mark.parametrize("sigma", [np.array([0.5, 0.1]), np.array([0.02, 3.0])])
def test_variances_of_many_recordings_are_found_whatever_the_prior(sigma):
    rng = np.random.default_rng(3)
    _, sums = drawn(rng, np.array([1.0, 2.0]), sigma, 400)
    one = np.zeros(400, dtype=np.intp)
    for scale in (0.05, 5.0):
        found = run_variance(sums, prior_of(scale), np.full(2, 100.0), one)
        assert np.sqrt(found) == pytest.approx(sigma, rel=0.12, abs=0.02)


def test_what_few_recordings_say_nothing_of_keeps_its_prior():
    sums = RunSums.stacked(
        RunSums(np.zeros((2, 2)), np.zeros(2), np.asarray(0.0), np.asarray(0.0), np.asarray(0.0))
        for _ in range(4)
    )
    found = run_variance(sums, prior_of([4.0, 9.0]), np.ones(2), np.zeros(4, dtype=np.intp))
    assert found == pytest.approx([4.0, 9.0])


def test_a_recording_is_judged_by_the_mean_of_the_others_of_its_unit():
    rng = np.random.default_rng(4)
    _, sums = drawn(rng, np.array([5.0, 0.0]), 0.3, 6)
    one = np.zeros(6, dtype=np.intp)
    levels = UnitLevels.of(sums, prior_of(1.0), np.ones(2), np.full(2, 100.0), one)
    rest = np.array([1, 2, 3, 4, 5])
    again = replace(levels, sums=sums[rest], groups=one[rest])
    assert levels.of_unit(0, 0).mean == pytest.approx(again.of_unit(0).mean)


def test_units_have_means_of_their_own_and_a_new_one_is_about_that_of_the_design():
    rng = np.random.default_rng(5)
    offsets = 2.0 * rng.standard_normal(12)
    parts = [drawn(rng, np.array([off, 1.0]), 0.1, 8)[1] for off in offsets]
    sums = RunSums.stacked(part[k] for part in parts for k in range(8))
    groups = np.repeat(np.arange(12), 8)
    levels = UnitLevels.of(sums, prior_of(1.0), np.ones(2), np.full(2, 100.0), groups)
    assert np.sqrt(levels.variance) == pytest.approx([0.1, 0.1], abs=0.03)
    assert np.sqrt(levels.unit_variance[0]) == pytest.approx(np.std(offsets, ddof=1), rel=0.2)
    assert levels.of_unit(3).mean[0] == pytest.approx(offsets[3], abs=0.15)
    new = levels.of_unit(99)
    assert new.mean[0] == pytest.approx(np.mean(offsets), abs=0.2)
    assert np.sqrt(new.covariance[0, 0]) > 1.0


def units_of_three():
    """Recordings of three units of two, three and four, and their sums."""
    rng = np.random.default_rng(6)
    offsets, groups = (0.7, -1.1, 0.2), np.repeat([0, 1, 2], [2, 3, 4])
    made, parts = [], []
    for unit, off in enumerate(offsets):
        data, sums = drawn(rng, np.array([off, 1.0]), 0.3, int((groups == unit).sum()))
        made += data
        parts += [sums[k] for k in range(len(sums))]
    levels = UnitLevels.of(
        RunSums.stacked(parts), prior_of(0.2), np.array([0.8, 0.1]), np.array([4.0, 9.0]), groups
    )
    return made, levels


def dense_mean_of_a_unit(made, levels, unit, left_out=-1):
    """Mean and covariance of a unit's mean by one Gaussian over all coefficients at once.

    The coefficients are the mean of the design, that of the unit and of each unit that was
    recorded; every recording is a row of data whose covariance is written out.
    """
    units = [*levels.units] if unit in levels.units else [*levels.units, unit]
    size = 2 + 2 * len(units)
    prior = np.kron(np.eye(1 + len(units)), np.eye(2)) * 0.0
    prior[:2, :2] = np.diag(levels.mean_prior)
    for place in range(len(units)):
        prior[2 + 2 * place : 4 + 2 * place, 2 + 2 * place : 4 + 2 * place] = np.diag(
            levels.unit_variance
        )
    information, vector = np.linalg.inv(prior), np.zeros(size)
    for place, ((x, y), group) in enumerate(zip(made, levels.groups, strict=True)):
        if place == left_out:
            continue
        at = units.index(int(group))
        wide = np.zeros((len(y), size))
        wide[:, :2] = wide[:, 2 + 2 * at : 4 + 2 * at] = x
        noise = x @ np.diag(levels.variance) @ x.T + NOISE**2 * np.eye(len(y))
        information += wide.T @ np.linalg.solve(noise, wide)
        vector += wide.T @ np.linalg.solve(noise, y)
    covariance = np.linalg.inv(information)
    mean, at = covariance @ vector, units.index(unit)
    pick = np.zeros((2, size))
    pick[:, :2] = pick[:, 2 + 2 * at : 4 + 2 * at] = np.eye(2)
    return pick @ mean, pick @ covariance @ pick.T


@pytest.mark.parametrize(("unit", "left_out"), [(0, -1), (1, 3), (2, 8), (7, -1)])
def test_the_mean_of_a_unit_is_that_of_the_whole_gaussian(unit, left_out):
    made, levels = units_of_three()
    found = levels.of_unit(unit, left_out)
    mean, covariance = dense_mean_of_a_unit(made, levels, unit, left_out)
    assert found.mean == pytest.approx(mean, rel=1e-6)
    assert found.covariance == pytest.approx(covariance, rel=1e-6, abs=1e-12)
    assert found.variance == pytest.approx(
        levels.variance if left_out < 0 else levels.known.likely(left_out)
    )


def test_a_design_without_a_unit_is_that_of_the_others_alone():
    _, levels = units_of_three()
    rest = np.flatnonzero(levels.groups != 1)
    alone = replace(levels, sums=levels.sums[rest], groups=levels.groups[rest])
    for found, other in zip(levels.design(without=1), alone.design(), strict=True):
        assert found == pytest.approx(other)
    assert levels.design()[0] != pytest.approx(alone.design()[0])


def test_what_is_left_beside_freed_coefficients_is_the_whole_gaussian():
    rng = np.random.default_rng(8)
    variance = np.array([0.5, 0.0])
    ((x, y),), sums = drawn(rng, 0.3, 0.5, 1)
    freed, noise = sums.freed(variance)[0], x @ np.diag(variance) @ x.T + NOISE**2 * np.eye(len(y))
    assert freed.gram == pytest.approx(x.T @ np.linalg.solve(noise, x))
    assert freed.cross == pytest.approx(x.T @ np.linalg.solve(noise, y))
    nats = freed.log_scale - 0.5 * freed.square - 0.5 * len(y) * np.log(2.0 * np.pi)
    assert nats == pytest.approx(multivariate_normal(np.zeros(len(y)), noise).logpdf(y))
    first = sums.first(1)
    assert first.gram[0] == pytest.approx(x[:, :1].T @ x[:, :1] / NOISE**2)
    assert first.cross[0] == pytest.approx(x[:, :1].T @ y / NOISE**2)
