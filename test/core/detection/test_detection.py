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

from __future__ import annotations

import importlib.util
import math

import numpy as np
import pytest
from scipy import stats
from support.observed import FLEA_COUNTS

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.detection.detection import Detector, TestResults
from flea_diag.core.detection.symbols import MIXED
from flea_diag.core.detection.window_limit import ResidualLimit, WindowLimit
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS

FLEA = compiled_relations("actuator.yaml").residuals

TestResults.__test__ = False  # a class of the package, not a test
NONE = (1e-9,) * len(UNIT_PARAMETERS)
MECHANICAL = FLEA.place["parity_mechanical"]
THERMAL = FLEA.place["motor_temperature"]


def motion(speed: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """No signals of relations; speed and direction of each scan."""
    speeds = np.atleast_1d(speed)
    return np.zeros((len(speeds), 0)), np.column_stack((speeds, np.sign(speeds)))


def sample(values: dict[str, float], speed: float = 0.03, spread=None) -> ResidualRows:
    row = np.full(len(FLEA.rows), math.nan)
    for name, value in values.items():
        row[FLEA.place[name]] = value
    spreads = np.zeros((1, len(FLEA.spreading), len(UNIT_PARAMETERS)))
    if spread is not None:
        spreads[:, FLEA.spreading.index(MECHANICAL)] = spread
    return ResidualRows(row[None], spreads, *motion(speed), np.array([abs(speed) > 0.01]))


def limit(name: str, windows: dict[int, float], k: float = 3.0, centre=(0.0, 0.0, 0.0)):
    entries = tuple(WindowLimit(w, centre, (s, 2 * s, 4 * s), k) for w, s in windows.items())
    return ResidualLimit(name, entries, (1.0, 1.0, 1.0))


def detector(*limits: ResidualLimit, tolerance=NONE, thermal=1e-9) -> Detector:
    return Detector(FLEA, limits, tolerance, thermal, counts=FLEA_COUNTS)


ALWAYS = [row.name for row in FLEA.rows if row.gate == "always"]


def test_false_alarms_on_white_noise_come_at_the_rate_of_the_limit():
    # Means of 50 white samples are normal with sigma / sqrt(50); disjoint windows and the
    # residuals of one scan are independent.
    random = np.random.default_rng(11)
    test = detector(*(limit(name, {50: 0.5 / math.sqrt(50)}, k=2.0) for name in ALWAYS))
    alarms, trials = 0, 150
    for _ in range(trials):
        for values in 0.5 * random.standard_normal((50, len(ALWAYS))):
            results = test.step(sample(dict(zip(ALWAYS, values, strict=True)), speed=0.0))
        alarms += int(results.deviating().sum())
    n, share = trials * len(ALWAYS), 2 * stats.norm.sf(2.0)
    assert n > 700
    assert alarms == pytest.approx(n * share, abs=4 * math.sqrt(n * share * (1 - share)))


def settle(test: Detector, value: float, count: int = 50, **kind) -> TestResults:
    for _ in range(count):
        results = test.step(sample({"parity_mechanical": value}, **kind))
    return results


def test_the_scale_is_that_of_the_speed_region():
    edges = ((0.0249, 5.0), (0.0251, 10.0), (0.0599, 10.0), (0.0601, 20.0))
    for speed, sigma in ((0.02, 5.0), (0.04, 10.0), (-0.08, 20.0), *edges):
        results = settle(detector(limit("parity_mechanical", {50: 5.0})), 30.0, speed=speed)
        assert results.z[0, MECHANICAL] == pytest.approx(30.0 / sigma), speed


def test_what_another_unit_may_differ_by_widens_the_scale():
    tolerance = (10.0, 100.0, *NONE[2:])
    spread = (-1.0, -0.04, *(0.0,) * len(NONE[2:]))
    test = detector(limit("parity_mechanical", {50: 3.0}), tolerance=tolerance)
    results = settle(test, 50.0, speed=0.02, spread=spread)
    # sqrt(3^2 + (10 * 1)^2 + (100 * 0.04)^2)
    assert results.z[0, MECHANICAL] == pytest.approx(50.0 / math.sqrt(9.0 + 100.0 + 16.0))


def test_the_spread_of_reversals_averages_out_before_it_is_squared():
    test = detector(limit("parity_mechanical", {50: 3.0}), tolerance=(10.0, *NONE[1:]))
    for k in range(50):
        spread = (1.0 if k % 2 else -1.0, *(0.0,) * len(NONE[1:]))
        results = test.step(sample({"parity_mechanical": 6.0}, speed=0.02, spread=spread))
    assert results.z[0, MECHANICAL] == pytest.approx(2.0)


def test_parity_residuals_are_tested_in_motion_only_and_keep_their_verdict_at_rest():
    test = detector(limit("parity_mechanical", {50: 5.0}))
    moved = settle(test, 30.0, speed=0.02).z[0, MECHANICAL]
    assert settle(test, -3000.0, speed=0.005).z[0, MECHANICAL] == moved
    assert settle(test, 0.0, speed=0.02).z[0, MECHANICAL] == pytest.approx(0.0)


def test_the_window_nearest_to_its_limit_speaks():
    test = detector(limit("parity_mechanical", {50: 5.0, 100: 1.0}))
    settle(test, 0.0, 100, speed=0.02)
    for _ in range(50):
        results = test.step(sample({"parity_mechanical": 8.0}, speed=0.02))
    # 50: 8 / 5 = 1.6 sigma; 100: the mean of 4 over 1 = 4 sigma.
    assert (results.window[0, MECHANICAL], results.z[0, MECHANICAL]) == (100, pytest.approx(4.0))
    assert results.symbol(MECHANICAL) == "+"
    assert results.symbol(THERMAL) == "0"


def test_adopting_a_parameter_is_as_if_it_had_been_known():
    zero, rest = (0.0,) * 6, len(NONE[7:])
    spread = (*zero, -170.0, *(0.0,) * rest)
    tolerance = (*NONE[:6], 0.15, *NONE[7:])
    test = detector(limit("parity_mechanical", {50: 5.0}), tolerance=tolerance)
    before = settle(test, 34.0, speed=0.02, spread=spread).z[0, MECHANICAL]
    assert before == pytest.approx(34.0 / math.hypot(5.0, 25.5))
    test.adopt((*zero, 0.2, *(0.0,) * rest), (*NONE[:6], 0.01, *NONE[7:]))
    # One more sample, already formed with the offset of 0.2 A that was learned.
    results = test.step(sample({"parity_mechanical": 0.0}, speed=0.02, spread=spread))
    assert results.z[0, MECHANICAL] == pytest.approx(0.0, abs=1e-9)
    assert settle(test, 10.0, speed=0.02, spread=spread).z[0, MECHANICAL] == pytest.approx(
        10.0 / math.hypot(5.0, 1.7)
    )


def test_what_was_never_tested_or_is_forgotten_deviates_not():
    assert not TestResults(len(FLEA.rows)).deviating().any()
    test = detector(limit("parity_mechanical", {50: 5.0}), limit("motor_temperature", {50: 1.0}))
    for _ in range(50):
        results = test.step(sample({"parity_mechanical": 99.0, "motor_temperature": 99.0}, 0.02))
    assert results.deviating().sum() == 2
    test.forget([MECHANICAL])
    results = test.step(sample({"motor_temperature": 99.0}, speed=0.0))
    assert results.deviating()[0].nonzero()[0].tolist() == [THERMAL]
    test.clear()
    assert not test.step(sample({"motor_temperature": 99.0})).deviating().any()


@pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="numba is an extra")
def test_compiled_loops_give_the_bits_of_numpy_whatever_blocks_come():
    random, scans = np.random.default_rng(5), 2500
    tested = [row.name for row in FLEA.rows if row.gate in ("moving", "always")]
    windows, centre = {50: 0.2, 100: 0.1, 400: 0.05}, (0.1, 0.2, 0.3)
    limits = [limit(name, windows, centre=centre) for name in tested]
    tolerance = random.uniform(0.1, 1.0, len(UNIT_PARAMETERS))
    values = random.standard_normal((scans, len(FLEA.rows)))
    values[random.random(values.shape) < 0.001] = math.nan
    spread = random.standard_normal((scans, len(FLEA.spreading), len(UNIT_PARAMETERS)))
    speed = 0.09 * np.sin(np.arange(scans) / 150.0)
    spread[700:710], speed[900:905] = math.nan, math.nan
    growth = 1.0 + np.maximum(random.standard_normal(values.shape), 0.0)

    def run(backend: str, lengths: list[int]) -> np.ndarray:
        test, found, start = (
            Detector(FLEA, limits, tolerance, 1e-3, backend, counts=FLEA_COUNTS),
            [],
            0,
        )
        for length in lengths:
            part = slice(start, start + length)
            moving = np.abs(speed[part]) > 0.01
            rows = ResidualRows(values[part], spread[part], *motion(speed[part]), moving)
            found.append(test.step(rows, growth[part]).table)
            start += length
            if start == 1000:
                test.adopt([0.1] * len(tolerance), tolerance / 2.0)
            if start == 1500:
                test.forget([MECHANICAL, THERMAL])
        return np.concatenate(found, axis=1)

    numpy = run("numpy", [1000, 500, 1000])
    assert np.isfinite(numpy).mean() > 0.2
    np.testing.assert_array_equal(run("numba", [1000, 500, 1000]), numpy)
    np.testing.assert_array_equal(run("numba", [1] * scans), numpy)


def test_a_mean_grows_by_the_mean_of_what_its_samples_grow_by():
    """A lag of one speed behind another cancels over a period, wherever in it the load is large."""
    name = "parity_speed"
    column, lag = FLEA.place[name], np.sin(2.0 * np.pi * np.arange(400) / 100.0)
    values, growth = np.zeros((400, len(FLEA.rows))), np.ones((400, len(FLEA.rows)))
    values[:, column] = lag + 0.2
    growth[lag > 0.0, column] = 25.0
    moving = np.ones(400, dtype=bool)
    spread = np.zeros((400, len(FLEA.spreading), len(UNIT_PARAMETERS)))
    rows = ResidualRows(values, spread, *motion(np.full(400, 0.05)), moving)
    inside, outside = (detector(limit(name, {400: 0.1})).step(rows, g) for g in (None, growth))
    grown = np.sqrt(growth[:, column].mean())
    assert outside.growth[-1, column] == pytest.approx(grown)
    assert outside.z[-1, column] * grown == pytest.approx(inside.z[-1, column])


def test_a_limit_that_grows_makes_no_deviation_smaller():
    found = TestResults(len(FLEA.rows), 2)
    found.z[:, :2], found.growth[:] = 4.0, 1.5
    found.shift[:, 1] = 0.3  # its limit does not grow
    assert [found.test(j)[0] for j in (0, 1)] == [6.0, 4.0]


def test_a_statistic_at_its_limit_does_not_exceed_it():
    results = TestResults(4)
    results.z[0] = 3.0, -3.0, 3.0001, -3.0001
    results.k[0] = 3.0
    assert results.deviating()[0].tolist() == [False, False, True, True]
    assert [results.symbol(index) for index in range(4)] == ["0", "0", "+", "-"]


def test_a_mean_has_a_direction_once_motion_in_it_has_lasted_for_its_window():
    results = TestResults(2, scans=4)
    results.window[:] = 3.0
    results.way = (1, -1, 1, 0), (2, 3, 4, 4)
    results.directed = frozenset({0})
    np.testing.assert_array_equal(results.direction(0), [MIXED, -1.0, 1.0, MIXED])
    assert results.direction(1).tolist() == [0.0] * 4


def test_a_statistic_is_told_in_sigmas_of_the_calibration_but_that_of_a_shift():
    results = TestResults(2)
    results.z[0], results.k[0], results.window[0], results.growth[0] = 4.0, 3.0, 50.0, 1.5
    results.shift[0, 1] = 0.2
    assert results.test(0) == (6.0, (50.0, 3.0, 0.0))
    assert results.test(1) == (4.0, (50.0, 3.0, 0.0))
