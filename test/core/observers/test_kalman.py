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

"""Kalman filter against the joint Gaussian of all states, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from support.models.linear_actuator import START, model, sharpened, simulated
from support.models.linear_model import LinearModel

from flea_diag.core.observers.kalman import KalmanFilter
from flea_diag.core.observers.state_filter import LOST, ConsistencyMonitor


def scalar(q: float, r: float) -> LinearModel:
    """A random walk, seen with noise."""
    one, none = np.ones((1, 1)), np.zeros((1, 1))
    return LinearModel(("x",), ("y",), ("u",), one, none, one, none, np.zeros(1), q * one, r * one)


def smoothed_jointly(
    given: LinearModel, U: np.ndarray, Y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the last state given everything, by one big Gaussian.

    All states x0..xT and readings are one linear map of independent noises; conditioning is
    the textbook formula, with no recursion at all.
    """
    n, p, T = len(given.A), len(given.H), len(Y)
    # x_k = mean_k + M_k (x0', w_1 .. w_T), the noises side by side.
    M = np.zeros((n, n * (T + 1)))
    M[:, :n] = np.eye(n)
    noise = np.zeros((n * (T + 1), n * (T + 1)))
    noise[:n, :n] = START
    mean, rows, means = np.zeros(n), [], []
    for k in range(T):
        at = n * (k + 1)
        M = given.A @ M
        M[:, at : at + n] = np.eye(n)
        noise[at : at + n, at : at + n] = given.Q
        mean = given.A @ mean + given.B @ U[k]
        rows.append(given.H @ M)
        means.append(given.H @ mean + given.h)
    seen = np.isfinite(Y).ravel()
    big_h, apart = np.concatenate(rows)[seen], (Y - np.array(means)).ravel()[seen]
    R = np.kron(np.eye(T), given.R)[np.ix_(seen, seen)]
    S = big_h @ noise @ big_h.T + R
    gain = M @ noise @ big_h.T @ np.linalg.inv(S)
    assert len(S) == seen.sum() <= T * p
    return mean + gain @ apart, M @ noise @ M.T - gain @ big_h @ noise @ M.T


@pytest.mark.parametrize("missing", [False, True])
def test_mean_and_covariance_are_those_of_the_joint_gaussian(missing: bool) -> None:
    given = model()
    _, U, Y = simulated(given, 25, 4)
    if missing:
        Y[3, 0] = Y[4] = Y[10:14, 1] = np.nan
    kalman = KalmanFilter(given, np.zeros(3), START)
    for u, y in zip(U, Y, strict=True):
        kalman.predict(u)
        kalman.update(y)
    mean, covariance = smoothed_jointly(given, U, Y)
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose((kalman.mean - mean) / scale, 0.0, atol=1e-6)
    np.testing.assert_allclose(
        kalman.covariance / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=1e-6
    )


def test_random_walk_settles_at_the_golden_ratio() -> None:
    # Q = R = 1: P = P + 1 - (P + 1)^2 / (P + 2), whose root is (sqrt(5) - 1) / 2.
    kalman = KalmanFilter(scalar(1.0, 1.0), np.zeros(1), np.eye(1))
    for _ in range(60):
        kalman.predict(np.zeros(1))
        told = kalman.update(np.array([0.0]))
    assert kalman.covariance[0, 0] == pytest.approx((5**0.5 - 1) / 2, rel=1e-12)
    assert told.sigma[0] ** 2 == pytest.approx((5**0.5 - 1) / 2 + 2)


def test_normalised_innovations_are_chi_square_and_white() -> None:
    given = sharpened(model(), 5.0)
    _, U, Y = simulated(given, 1500, 8)
    kalman = KalmanFilter(given, np.zeros(3), START)
    nis, z = [], []
    for u, y in zip(U, Y, strict=True):
        kalman.predict(u)
        told = kalman.update(y)
        nis.append(told.nis)
        z.append(told.residual / told.sigma)
        assert not told.diverged
    assert stats.kstest(nis, "chi2", args=(2,)).pvalue > 0.01
    first, second = np.array(z)[:, 0], np.array(z)[:, 1]
    for column in (first, second):
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 3.3 / np.sqrt(1500)


def test_frozen_runs_open_loop_whatever_is_measured() -> None:
    given = model()
    _, U, Y = simulated(given, 30, 2)
    start = np.array([0.2, 3.0, 0.01])
    kalman = KalmanFilter(given, start, START)
    for u, y in zip(U, Y, strict=True):
        kalman.predict(u)
        told = kalman.update(y + 5.0, frozen=True)
    x = start
    for u in U:
        x = given.A @ x + given.B @ u
    np.testing.assert_allclose(kalman.mean, x)
    np.testing.assert_allclose(told.residual, Y[-1] + 5.0 - given.H @ x - given.h)


def test_scan_without_any_reading_only_predicts() -> None:
    given = model()
    kalman = KalmanFilter(given, np.ones(3), START)
    kalman.predict(np.zeros(3))
    told = kalman.update(np.full(2, np.nan))
    assert told.measured == 0
    assert told.nis == 0.0
    np.testing.assert_allclose(kalman.mean, given.A @ np.ones(3))
    np.testing.assert_array_equal(told.sigma, 0.0)
    np.testing.assert_allclose(told.prediction, given.H @ given.A @ np.ones(3) + given.h)


def test_consistency_forgives_one_outlier_and_not_a_lost_track() -> None:
    monitor = ConsistencyMonitor()
    assert not monitor.step(1e12, 2)
    for _ in range(20):
        assert not monitor.step(2.0, 2)
    steps = next(k for k in range(1000) if monitor.step(4.0 * LOST * 2, 2))
    assert steps < 50
    assert not all(monitor.step(2.0, 2) for _ in range(500))


def test_consistency_takes_what_is_no_number_for_lost() -> None:
    monitor = ConsistencyMonitor()
    assert [monitor.step(np.nan, 2) for _ in range(100)][-1]
    assert not [monitor.step(2.0, 2) for _ in range(500)][-1]


def test_what_healthy_units_are_expected_to_differ_by_is_no_lost_track() -> None:
    monitor = ConsistencyMonitor(expected=4.0)
    assert not any(monitor.step(35.0 * 2, 2) for _ in range(500))  # below 3^2 times 4
    assert any(monitor.step(40.0 * 2, 2) for _ in range(500))
