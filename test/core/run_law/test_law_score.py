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

"""What a law is scored by, against dense Gaussians, and what its entries become as arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from flea_diag.core.run_law.law_noise import LawNoise
from flea_diag.core.run_law.law_score import law_score, standardised_means
from flea_diag.core.run_law.motion_noise import ANY_MOTION
from flea_diag.core.run_law.restricted_likelihood import Spread
from flea_diag.core.run_law.run_law import LawTerm, RelationNoise, RunLaw
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import MOTIONS, RunWindows

SIGMA = np.array([0.4, 1.5])
NOISE = LawNoise(
    np.square(SIGMA), np.zeros(2), np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)),
    np.tile(ANY_MOTION, (2, 1)),
)  # fmt: skip
LAW = Spread(np.array([0.5, -0.2]), np.array([0.3, 0.1]), np.array([[0.2, 0.05], [0.05, 0.1]]))


def recordings(count: int = 4, windows: int = 30) -> tuple[list[RunWindows], list[np.ndarray]]:
    """Recordings of this law, the second relation with 9 values in the last of them."""
    rng = np.random.default_rng(3)
    total = np.linalg.cholesky(np.diag(LAW.variance) + LAW.covariance)
    runs, columns = [], []
    for place in range(count):
        x = rng.normal(1.0, 0.3, (windows, 2, 2))
        made = LAW.mean + total @ rng.standard_normal(2)
        values = x @ made + SIGMA * rng.standard_normal((windows, 2))
        if place == count - 1:
            values[9:, 1] = np.nan
        still = np.zeros((windows, len(MOTIONS)))
        runs.append(RunWindows(str(place), "", values, x, still))
        columns.append(x)
    return runs, columns


def test_the_mean_of_a_recording_is_standardised_by_all_that_it_may_differ_by():
    runs, columns = recordings()
    found = [standardised_means(r, x, NOISE, LAW) for r, x in zip(runs, columns, strict=True)]
    assert list(map(len, found)) == [2, 2, 2, 1]  # nine values are no mean
    run, x, total = runs[0], columns[0], np.diag(LAW.variance) + LAW.covariance
    for relation, value in enumerate(found[0]):
        mean_x = x[:, relation].mean(axis=0)
        variance = mean_x @ total @ mean_x + SIGMA[relation] ** 2 / len(run)
        off = run.values[:, relation].mean() - mean_x @ LAW.mean
        assert value == pytest.approx(off / math.sqrt(variance))


def test_ten_values_are_a_mean():
    (run, *_), (x, *_) = recordings()
    run.values[10:, 0] = np.nan
    assert len(standardised_means(run, x, NOISE, LAW)) == 2


def test_a_law_is_scored_by_the_density_of_one_value():
    runs, columns = recordings()
    white = [NOISE.whitened(run, x) for run, x in zip(runs, columns, strict=True)]
    sums = RunSums.stacked(RunSums.of(each) for each in white)
    score = law_score(runs, columns, NOISE, sums, [LAW] * len(runs))
    assert score is not None
    total, nats, count = np.diag(LAW.variance) + LAW.covariance, 0.0, 0
    for run, x in zip(runs, columns, strict=True):
        known = np.isfinite(run.values)
        rows, y = x[known], run.values[known]
        noise = np.diag(np.broadcast_to(np.square(SIGMA), known.shape)[known])
        whole = rows @ total @ rows.T + noise
        off = y - rows @ LAW.mean
        log_det = np.linalg.slogdet(2.0 * np.pi * whole)[1]
        nats -= 0.5 * (log_det + off @ np.linalg.solve(whole, off))
        count += len(y)
    assert score.log_score == pytest.approx(nats / count)
    means = np.concatenate(
        [standardised_means(run, x, NOISE, LAW) for run, x in zip(runs, columns, strict=True)]
    )
    assert score.means == len(means) == 7
    assert score.spread == pytest.approx(math.sqrt(np.mean(means**2)))
    assert score.beyond_two == pytest.approx(np.mean(np.abs(means) > 2.0))


def test_beside_it_stands_one_variance_of_each_relation_learned_without_the_recording():
    runs, columns = recordings()
    sums = RunSums.stacked(
        RunSums.of(NOISE.whitened(run, x)) for run, x in zip(runs, columns, strict=True)
    )
    score = law_score(runs, columns, NOISE, sums, [LAW] * len(runs))
    nats, count = 0.0, 0
    for place, run in enumerate(runs):
        others = np.concatenate([other.values for k, other in enumerate(runs) if k != place])
        for relation in range(2):
            sigma = math.sqrt(np.nanmean(np.square(others[:, relation])))
            values = run.values[np.isfinite(run.values[:, relation]), relation]
            nats += norm.logpdf(values, 0.0, sigma).sum()
            count += len(values)
    assert score is not None
    assert score.separate == pytest.approx(nats / count)


def test_two_recordings_have_no_score():
    runs, columns = recordings(2)
    sums = RunSums.stacked(
        RunSums.of(NOISE.whitened(run, x)) for run, x in zip(runs, columns, strict=True)
    )
    assert law_score(runs, columns, NOISE, sums, [LAW] * 2) is None


def law(units: int = 1) -> RunLaw:
    terms = tuple(
        LawTerm(name, "design", float(place), 0.1 * (place + 1), 0.2 * (place + 1))
        for place, name in enumerate(("one", "two", "three"))
    )
    noise = (
        RelationNoise("drag", 0.4, 0.3, 0.5),
        RelationNoise("circuit", 1.5, 0.0, 0.2, (0.25,), (0.5, 1.0, 0.0, 0.0, 0.0, 0.5)),
    )
    lower = ((1.0,), (0.2, 2.0), (0.3, -0.4, 3.0))
    return RunLaw(terms, noise, lower, 12, units, 30.0)


def test_the_lower_triangle_is_the_whole_covariance():
    whole = np.array([[1.0, 0.2, 0.3], [0.2, 2.0, -0.4], [0.3, -0.4, 3.0]])
    assert law().covariance.tolist() == whole.tolist()


def test_entries_of_noise_become_variances():
    noise = law().law_noise
    assert noise.white == pytest.approx([0.16, 2.25])
    assert noise.coloured == pytest.approx([0.09, 0.0])
    assert noise.phi.tolist() == [0.5, 0.2]
    assert noise.shared.tolist() == [[0.0, 0.0], [0.25, 0.0]]
    assert noise.sigma == pytest.approx([0.5, 1.5])
    assert noise.long_run == pytest.approx([math.sqrt(0.16 + 0.09 * 3.0), 1.5])
    assert noise.motion[0].tolist() == list(ANY_MOTION)


def test_another_unit_differs_by_what_units_do_and_one_of_many_units_always_does():
    runs = np.square([0.1, 0.2, 0.3])
    assert law(1).spread().variance == pytest.approx(runs)
    assert law(1).spread(another_unit=True).variance == pytest.approx(5.0 * runs)
    assert law(2).spread().variance == pytest.approx(5.0 * runs)


@pytest.mark.parametrize("minutes", [1.0 / 6.0, 1.0, 10.0])
def test_a_term_drifts_in_a_minute_as_a_process_of_first_order_does(minutes):
    found = RunLaw((LawTerm("one", "design", 0.0, 0.7),), (), ((1.0,),), 3, 1, 60.0 * minutes)
    # Var(x(t + 60 s) - x(t)) = 2 sigma^2 (1 - exp(-60 s / tau))
    expected = math.sqrt(2.0 * 0.7**2 * (1.0 - math.exp(-1.0 / minutes)))
    assert found.drift_per_minute(found.terms[0]) == pytest.approx(expected)
