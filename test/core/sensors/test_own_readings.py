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

"""Channels that come at a rate of their own, or lack readings: tests count those that came."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from support import in_turn
from support.observed import FLEA_COUNTS

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.sensors.own_readings import (
    KEPT,
    OwnReadings,
    ReadingTrain,
    train_logs,
    train_steps,
    unusual,
)
from flea_diag.core.sensors.sensor_limits import SensorLimit, noise_logs, sensor_limits
from flea_diag.core.sensors.sensor_tests import SensorTests

FLEA = compiled_relations("actuator.yaml").residuals.sensors
NAMES = ("motor_speed", "actuator_position", "load_position")
SCANS = 3000
TIME_S = 0.01 * np.arange(SCANS)
LOST = ["half", "one_of_33", 0.03, 0.1, 0.3]


def healthy(seed: int) -> np.ndarray:
    """An encoder that counts and two positions with noise: a sine that stops now and then."""
    draw = np.random.default_rng(seed)
    motion = np.where(np.arange(SCANS) // 250 % 2, 0.03, 0.03 * np.cos(1.6 * np.pi * TIME_S))
    positions = 0.05 + motion[:, None] + 6e-5 * draw.standard_normal((SCANS, 2))
    turning = np.gradient(motion, 0.01) / 5e-4
    speed = turning + 0.5 * draw.standard_normal(SCANS) * (np.abs(turning) > 1e-9)
    steps = np.array([0.01, 4e-6, 4e-6])
    return np.round(np.column_stack((speed, positions)) / steps) * steps


def lacking(rows: np.ndarray, how: str | float) -> np.ndarray:
    found = rows.copy()
    if how == "half":
        found[1::2] = math.nan
    elif how == "one_of_33":
        found[32::33] = math.nan
    else:
        found[np.random.default_rng(5).random(rows.shape) < how] = math.nan
    return found


@pytest.fixture(scope="module")
def limits() -> tuple[SensorLimit, ...]:
    runs = [dict(zip(NAMES, healthy(seed).T, strict=True)) for seed in range(8)]
    return sensor_limits(runs, FLEA, 0.1, 0.01)


def run(limits, rows: np.ndarray, block: int = 50, backend: str = "numpy"):
    tests = SensorTests(limits, NAMES, FLEA, backend, period_s=0.01, counts=FLEA_COUNTS)
    tests.bound("load_position", 0.0, 0.0795)
    done = [tests.step(rows[k : k + block]) for k in range(0, len(rows), block)]
    return np.concatenate([d.usable for d in done]), np.concatenate([d.z for d in done]), tests.k


def louder(count: int) -> np.ndarray:
    return 3e-3 * np.random.default_rng(1).standard_normal(count)


def called(limits, rows: np.ndarray) -> dict[str, int]:
    _, z, k = run(limits, rows)
    with np.errstate(invalid="ignore"):
        beyond = np.abs(z) > k
    return {FLEA.names[j]: int(np.argmax(beyond[:, j])) for j in np.flatnonzero(beyond.any(axis=0))}


def train(values: list[float], scans: list[int]) -> ReadingTrain:
    return ReadingTrain(np.array(values, dtype=float)[:, None], np.array(scans), len(scans))


@pytest.mark.parametrize("scans", [[0, 1, 2, 3], [0, 2, 4, 6], [0, 1, 4, 9]])
def test_noise_of_uneven_readings_is_blind_to_a_parabola_and_has_unit_gain(scans) -> None:
    parabola = [3.0 + 2.0 * t + 0.5 * t * t for t in scans]
    assert train_logs(train(parabola, scans), 1e-9)[3] < math.log(1e-8)
    draw = 0.3 * np.random.default_rng(1).standard_normal((4, 4000))
    logs = [train_logs(train(column.tolist(), scans), 1e-12)[3] for column in draw.T]
    # E ln|x| of a standard normal x is -(ln 2 + Euler's constant) / 2.
    assert np.mean(logs) == pytest.approx(math.log(0.3) - 0.635, abs=0.06)


def test_noise_of_readings_that_lack_nothing_is_that_of_scans() -> None:
    values = np.random.default_rng(2).standard_normal(50)
    own = train_logs(train(values.tolist(), list(range(50))), 1e-3)
    np.testing.assert_array_equal(own[3:], noise_logs(values, 1e-3))
    assert np.isnan(own[:3]).all()


def test_a_reading_may_go_as_much_farther_as_it_comes_later() -> None:
    moved = train([0.0, 2.5, 5.5, 5.5], [0, 2, 3, 7])
    assert unusual(moved, reach=2.0).tolist() == [False, False, True, True]
    assert unusual(moved, reach=1.0).tolist() == [False, True, True, True]


def test_a_step_is_told_between_uneven_readings_of_a_motion() -> None:
    scans = np.array([0, 1, 3, 4, 5, 7, 8, 10, 11, 12, 14, 15])
    moving = 0.4 * scans
    assert abs(train_steps(train(moving.tolist(), scans.tolist()))[-1, 0]) < 1e-12
    stepped = moving + 3.0 * (scans > 7)
    found = train_steps(train(stepped.tolist(), scans.tolist()))
    # Over the two scans that the longest gap is.
    assert 2.0 * found[-1, 0] == pytest.approx(3.0, rel=0.05)
    assert np.isnan(found[:-1]).all()


def test_trains_are_those_that_came_whatever_the_blocks() -> None:
    rows = lacking(healthy(3), 0.3)[:200]
    expected = np.flatnonzero(~np.isnan(rows[:, 1]))
    for block in (1, 7, 200):
        own, places = OwnReadings([(1,)]), []
        for first in range(0, 200, block):
            recent = np.full((KEPT + len(rows[first : first + block]), 3), math.nan)
            known = rows[max(first - KEPT, 0) : first + block]
            recent[len(recent) - len(known) :] = known
            trains = own.step(first, recent, len(rows[first : first + block]))
            places += (trains[(1,)].places + first).tolist() if trains else []
        assert places == expected[: len(places)].tolist() == expected.tolist()


@pytest.mark.slow
@pytest.mark.parametrize("how", LOST)
def test_healthy_channels_that_lack_readings_are_quiet(limits, how) -> None:
    for seed in range(100, 104):
        assert called(limits, lacking(healthy(seed), how)) == {}


FAULTS = {
    "actuator_position_noise": (1, lambda v: v + louder(len(v))),
    "actuator_position_stuck": (1, lambda v: np.full(len(v), v[0])),
    "motor_speed_dropout": (0, lambda v: v * (np.arange(len(v)) % 60 >= 10)),
    "actuator_position": (1, lambda v: v + 8e-3),
}
"""What a test sees -> the channel, and what is wrong with its readings."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "how"), in_turn(list(product(FAULTS, LOST))))
def test_a_fault_shows_though_readings_are_missing(limits, name, how) -> None:
    rows, (column, spoil) = healthy(30), FAULTS[name]
    rows[1520:, column] = spoil(rows[1520:, column])
    assert 1520 <= called(limits, lacking(rows, how))[name] < 2500


def spoilt(how: str | float) -> np.ndarray:
    """All that the tests look for, one after the other, and a position at the end of its range."""
    rows = healthy(20)
    rows[800:, 1] += 0.01
    rows[1200:, 1:] += 0.004
    rows[1500:1560, 2] = rows[1500, 2]
    for first in (1900, 2100):
        rows[first : first + 8, 0] = 0.0
    rows[2300:, 0] += 5.0 * np.random.default_rng(2).standard_normal(700)
    return lacking(rows, how)


@pytest.mark.in_turn(2)
@pytest.mark.slow
@pytest.mark.parametrize(("how", "rested"), in_turn([("half", True), (0.1, False), (0.3, True)], 3))
def test_blocks_and_both_backends_give_the_same_bits(limits, how, rested) -> None:
    pytest.importorskip("numba")
    known = [replace(limit, rested=rested) for limit in limits]
    rows = spoilt(how)
    expected = run(known, rows, 250)
    for backend, block in (("numpy", 7), ("numba", 1), ("numba", 700)):
        found = run(known, rows, block, backend)
        np.testing.assert_array_equal(found[0], expected[0])
        np.testing.assert_array_equal(found[1], expected[1])


def test_a_window_of_noise_counts_readings(limits) -> None:
    """At half the rate it takes twice as long, whatever the phase."""
    rows = healthy(31)
    rows[1000:, 1] += 3e-3 * np.random.default_rng(3).standard_normal(SCANS - 1000)
    name = "actuator_position_noise"
    whole, half = called(limits, rows)[name], called(limits, lacking(rows, "half"))[name]
    assert 1.3 < (half - 1000) / (whole - 1000) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("hz", [1.0, 2.0])
def test_a_slow_thermocouple_is_tested_by_its_own_rate(hz) -> None:
    """It measures once or twice a second, to 0.1 K, and is held in between."""

    def readings(seed: int) -> np.ndarray:
        every = round(100 / hz)
        draw = np.random.default_rng(seed)
        measured = 25.0 + 0.15 * draw.standard_normal(6000 // every)
        return np.repeat(np.round(measured, 1), every)

    name = "motor_temperature"
    (limit,) = sensor_limits([{name: readings(seed)} for seed in range(8)], FLEA, 0.1, 0.01)
    assert limit.every == round(100 / hz)
    # Of one in five that repeats, so many that once in 10 h by chance is shared by all tests.
    assert 8 <= limit.repeats / limit.every <= 14
    place = FLEA.names.index(f"{name}_stuck")
    for seed, dead in [(s, False) for s in range(50, 70)] + [(70, True)]:
        rows = readings(seed)[:, None]
        rows[2000:] = 0.0 if dead else rows[2000:]
        tests = SensorTests([limit], [name], FLEA, "numpy", period_s=0.01, counts=FLEA_COUNTS)
        z = tests.step(rows).z[:, place]
        assert (z > tests.k[place]).any() == dead
        if dead:
            first = int(np.argmax(z > tests.k[place]))
            assert first == pytest.approx(2000 + limit.repeats, abs=2)


def test_a_finely_read_position_that_goes_by_a_count_at_rest_has_no_drop_out(limits) -> None:
    rows = healthy(40)
    rests = slice(1250, 1500)
    count = np.repeat(np.random.default_rng(6).integers(0, 2, 10), 25)
    rows[rests, 1] = 0.08 + 4e-6 * count
    rows[rests, 0] = 0.0
    assert not any(name.endswith("dropout") for name in called(limits, rows))


def moving(seed: int) -> np.ndarray:
    """Motion that turns and never rests."""
    draw = np.random.default_rng(seed)
    motion = 0.03 * np.cos(1.6 * np.pi * TIME_S)
    positions = 0.05 + motion[:, None] + 6e-5 * draw.standard_normal((SCANS, 2))
    speed = np.gradient(motion, 0.01) / 5e-4 + 0.5 * draw.standard_normal(SCANS)
    return np.round(np.column_stack((speed, positions)) / [0.01, 4e-6, 4e-6]) * [0.01, 4e-6, 4e-6]


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 50])
def test_at_rest_nothing_is_judged_that_no_recording_shows_at_rest(block) -> None:
    runs = [dict(zip(NAMES, moving(seed).T, strict=True)) for seed in range(8)]
    unseen = sensor_limits(runs, FLEA, 0.1, 0.01)
    assert [limit.rested for limit in unseen] == [False] * 3
    stuck = [FLEA.names.index(f"{name}_stuck") for name in NAMES]
    for rests in (True, False):
        rows = moving(20)
        rows[1000:1600, 1] = rows[1000, 1]
        if rests:
            rows[1000:1600] = [0.0, *rows[1000, 1:]]
        _, z, k = run(unseen, rows, block)
        assert (z[:, stuck] > k[stuck]).any(axis=0).tolist() == [False, not rests, False]


def test_recordings_with_rests_show_what_is_right_at_rest(limits) -> None:
    assert [limit.rested for limit in limits] == [True] * 3
