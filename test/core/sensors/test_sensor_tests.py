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

"""Sensors by themselves: noise, held readings, drop-outs, steps; rows one by one and in blocks."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest
from support.observed import FLEA_COUNTS
from support.places import WING

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.sensors.noise_test import WARM_UP_SCANS, NoiseTest
from flea_diag.core.sensors.position_step import SPAN, position_steps
from flea_diag.core.sensors.sensor_limits import SensorLimit, noise_logs, sensor_limits
from flea_diag.core.sensors.sensor_set import SensorSet
from flea_diag.core.sensors.sensor_tests import SensorTests
from flea_diag.errors import ConfigurationError
from flea_diag.fields.reader import read_as

FLEA = compiled_relations("actuator.yaml").residuals.sensors
NAMES = FLEA.names
CHANNELS = ("motor_current", "actuator_position", "motor_temperature")
SIGMA = np.array([0.2, 6e-5, 0.4])
RESOLUTION = np.array([1e-3, 4e-6, 0.01])
SCANS = 3000
TIME = np.arange(SCANS) / 100.0
MOVES = 0.03 * np.sin(2 * np.pi * 0.5 * np.arange(SCANS) / 100.0)


def healthy(seed: int, scans: int = SCANS) -> np.ndarray:
    noise = SIGMA * np.random.default_rng(seed).standard_normal((scans, 3))
    motion = np.resize(MOVES, scans)
    true = np.stack((1.0 + 30.0 * motion, 0.05 + motion, np.full(scans, 25.0)), axis=1)
    return np.round((true + noise) / RESOLUTION) * RESOLUTION


@pytest.fixture(scope="module")
def limits() -> tuple[SensorLimit, ...]:
    """Of a stand whose rest was seen as well: where a motion turns, all is judged."""
    runs = [dict(zip(CHANNELS, healthy(seed).T, strict=True)) for seed in range(8)]
    return tuple(replace(limit, rested=True) for limit in sensor_limits(runs, FLEA, 0.1, 0.01))


def run(limits, rows: np.ndarray, block: int = 1):
    tests = SensorTests(limits, CHANNELS, FLEA, period_s=0.01, counts=FLEA_COUNTS)
    done = [tests.step(rows[k : k + block]) for k in range(0, len(rows), block)]
    z = np.concatenate([part.z for part in done])
    return np.concatenate([part.usable for part in done]), z, done[0].k


def called(limits, rows: np.ndarray) -> dict[str, int]:
    """Name of each test beyond its limit, and the first scan at which it was."""
    _, z, k = run(limits, rows, 50)
    with np.errstate(invalid="ignore"):
        beyond = np.abs(z) > k
    return {NAMES[j]: int(np.argmax(beyond[:, j])) for j in np.flatnonzero(beyond.any(axis=0))}


def test_log_noise_of_white_noise_is_that_of_a_normal_variable():
    white = 0.3 * np.random.default_rng(1).standard_normal(200_000)
    # E ln|x| of a standard normal x is -(ln 2 + Euler's constant) / 2.
    expected = math.log(0.3) - 0.5 * (math.log(2.0) + 0.5772156649)
    assert noise_logs(white, 1e-9).mean() == pytest.approx(expected, abs=0.01)
    parabola = 3.0 + 2.0 * np.arange(50.0) + 0.5 * np.arange(50.0) ** 2
    assert np.allclose(noise_logs(parabola, 1e-3), math.log(1e-3))


def test_a_reading_at_the_end_of_its_range_is_not_quiet_either(limits):
    rows = healthy(12)
    rows[1000:2200, 1] = 0.1
    tests = SensorTests(limits, CHANNELS, FLEA, period_s=0.01, counts=FLEA_COUNTS)
    tests.bound("actuator_position", 0.0, 0.1)
    z = np.concatenate([tests.step(rows[k : k + 50]).z for k in range(0, SCANS, 50)])
    quiet = NAMES.index("actuator_position_noise")
    assert not (np.abs(z[:, quiet]) > tests.k[quiet]).any()


@pytest.mark.parametrize("block", [1, 50])
def test_an_encoder_that_holds_zero_at_rest_is_not_stuck_and_in_motion_it_is(block):
    """The same held readings, with a position that rests meanwhile or moves on."""
    names = ("motor_speed", "load_position")

    def recording(seed: int) -> np.ndarray:
        draw = np.random.default_rng(seed)
        position = 0.05 + MOVES + 6e-5 * draw.standard_normal(SCANS)
        speed = np.gradient(MOVES, 0.01) / 5e-4 + 0.5 * draw.standard_normal(SCANS)
        return np.round(np.stack((speed, position), axis=1) / [0.01, 4e-6]) * [0.01, 4e-6]

    learned = sensor_limits(
        [dict(zip(names, recording(seed).T, strict=True)) for seed in range(8)], FLEA, 0.1, 0.01
    )
    stuck = NAMES.index("motor_speed_stuck")
    for rests in (True, False):
        rows = recording(20)
        rows[1000:1600, 0] = 0.0
        if rests:
            rows[1000:1600, 1] = 0.05 + 6e-5 * np.random.default_rng(3).standard_normal(600)
        tests = SensorTests(learned, names, FLEA, period_s=0.01, counts=FLEA_COUNTS)
        z = np.concatenate([tests.step(rows[k : k + block]).z for k in range(0, SCANS, block)])
        assert (z[:, stuck] > tests.k[stuck]).any() == (not rests)


def encoded(seed: int) -> np.ndarray:
    """An encoder and a position that move, rest, and move on."""
    draw = np.random.default_rng(seed)
    motion = np.where(np.arange(SCANS) // 250 % 2, 0.03, 0.03 * np.cos(1.6 * np.pi * TIME))
    position = 0.05 + motion + 6e-5 * draw.standard_normal(SCANS)
    turning = np.gradient(motion, 0.01) / 5e-4
    speed = turning + 0.5 * draw.standard_normal(SCANS) * (np.abs(turning) > 1e-9)
    return np.round(np.stack((speed, position), axis=1) / [0.01, 4e-6]) * [0.01, 4e-6]


@pytest.mark.parametrize(
    ("kind", "spoil"),
    [
        ("noise", lambda v, k: v + 10.0 * np.random.default_rng(k).standard_normal()),
        ("dropout", lambda v, k: v * (k % 60 >= 5)),
    ],
)
def test_an_encoder_that_rests_half_of_the_time_is_tested_while_it_turns(kind, spoil):
    names = ("motor_speed", "actuator_position")
    runs = [dict(zip(names, encoded(seed).T, strict=True)) for seed in range(8)]
    learned = sensor_limits(runs, FLEA, 0.1, 0.01)
    (limit,) = (limit for limit in learned if limit.channel == "motor_speed")
    assert limit.scatter < 2.0
    assert 0 < limit.repeats <= 4
    at = NAMES.index(f"motor_speed_{kind}")
    for wrong in (False, True):
        rows = encoded(30)
        if wrong:
            rows[1500:, 0] = [spoil(v, k) for k, v in enumerate(rows[1500:, 0])]
        tests = SensorTests(learned, names, FLEA, period_s=0.01, counts=FLEA_COUNTS)
        z = np.concatenate([tests.step(rows[k : k + 50]).z for k in range(0, SCANS, 50)])
        first = int(np.argmax(z[:, at] > tests.k[at]))
        assert (1500 < first < 1900) if wrong else first == 0


@pytest.mark.parametrize("block", [1, 50])
def test_a_step_of_both_positions_is_motion_and_one_of_either_is_the_sensors(block):
    names = ("actuator_position", "load_position")

    def readings(seed: int) -> np.ndarray:
        noise = 6e-5 * np.random.default_rng(seed).standard_normal((SCANS, 2))
        return 0.05 + MOVES[:, None] + noise

    runs = [dict(zip(names, readings(seed).T, strict=True)) for seed in range(8)]
    learned = sensor_limits(runs, FLEA, 0.1, 0.01)
    for stepped in ((0, 1), (0,), (1,)):
        rows = readings(20)
        rows[1500:, stepped] += 0.0012
        tests = SensorTests(learned, names, FLEA, period_s=0.01, counts=FLEA_COUNTS)
        z = np.concatenate([tests.step(rows[k : k + block]).z for k in range(0, SCANS, block)])
        seen = {
            column for column in (0, 1) if np.nanmax(np.abs(z[:, NAMES.index(names[column])])) > 1.0
        }
        assert seen == (set(stepped) if len(stepped) == 1 else set())


@pytest.mark.parametrize("size", [0.002, -0.002])
def test_a_step_is_measured_through_motion(size):
    position = 0.05 + MOVES[:200].copy()
    position[100:] += size
    steps = position_steps(position)
    assert steps[100 - SPAN] == pytest.approx(size, rel=0.1)
    assert np.argmax(np.abs(steps)) == 100 - SPAN


def test_motion_outliers_and_a_hard_stop_are_no_step():
    assert np.abs(position_steps(MOVES)).max() < 1e-4
    pierced = MOVES.copy()
    pierced[100] += 0.002
    # Medians of a ramp move on by one scan at most, here 0.94 mm.
    assert np.abs(position_steps(pierced)).max() < 9.5e-4
    stopped = np.minimum(0.001 * np.arange(100.0), 0.05)  # 0.1 m/s, then an end stop
    assert np.abs(position_steps(stopped)).max() < 3e-4
    # Thrown off a soft end stop: half a period of 60 ms of its spring, and back as it came.
    time = np.arange(-10, 20) / 100.0
    spring = 2.0 * np.pi / 0.12
    speed, back = 0.13, np.clip(time, 0.0, 0.06)
    thrown = speed * (np.abs(time - back) - np.sin(spring * back) / spring)
    assert np.abs(position_steps(thrown)).max() < 3e-4
    missing = MOVES[:50].copy()
    missing[20] = np.nan
    assert np.isnan(position_steps(missing)[20 - 2 * SPAN + 1 : 21]).all()


def test_healthy_sensors_are_quiet_and_all_usable(limits):
    for seed in range(100, 104):
        rows = healthy(seed, 6000)
        assert called(limits, rows) == {}
        assert np.array_equal(run(limits, rows, 50)[0], rows)


@pytest.mark.parametrize("block", [7, 250, 3000])
def test_blocks_give_the_same_bits_as_single_rows(limits, block):
    rows = healthy(9)
    rows[1000:1005, 0] = 0.0
    rows[1200:, 1] += 0.004
    rows[1500:1600, 2] = 25.0
    rows[2000:2003] = np.nan
    rows[2400:, 0] += np.random.default_rng(2).standard_normal(600)
    usable, z, _ = run(limits, rows)
    in_blocks = run(limits, rows, block)
    assert np.array_equal(usable, in_blocks[0], equal_nan=True)
    assert np.array_equal(z, in_blocks[1], equal_nan=True)


@pytest.mark.parametrize(("column", "level"), [(0, 0.0), (1, 0.0), (2, 25.1)])
def test_a_held_reading_is_stuck_and_withheld(limits, column, level):
    rows = healthy(10)
    rows[1500:, column] = level
    name = f"{CHANNELS[column]}_stuck"
    found = called(limits, rows)
    assert found[name] == pytest.approx(1550, abs=3)
    assert not any(each.endswith("dropout") for each in found)
    assert np.isnan(run(limits, rows, 50)[0][1510:, column]).all()


@pytest.mark.parametrize("column", [0, 1, 2])
def test_a_missing_reading_ends_no_hold(limits, column):
    """Another channel that is saturated may take a reading away for a scan."""
    rows = healthy(10)
    rows[1500:, column] = 0.0
    rows[[1527, 1534], column] = np.nan
    found = called(limits, rows)
    assert found[f"{CHANNELS[column]}_stuck"] == pytest.approx(1552, abs=3)
    assert not any(each.endswith("dropout") for each in found)


@pytest.mark.parametrize("column", [0, 1, 2])
def test_the_second_drop_out_is_called_and_neither_reaches_a_mean(limits, column):
    rows = healthy(11)
    for start in (1500, 2100):
        rows[start : start + 5, column] = 0.0
    found = called(limits, rows)
    assert found == {f"{CHANNELS[column]}_dropout": pytest.approx(2105, abs=1)}
    once = rows.copy()
    once[2100:2105] = healthy(11)[2100:2105]
    assert called(limits, once) == {}
    if column == 1:
        assert np.isnan(run(limits, rows, 50)[0][1500:1505, 1]).all()


def test_drop_outs_farther_apart_than_the_memory_are_forgotten(limits):
    rows = healthy(12, 5000)
    for start in (1500, 3600):
        rows[start : start + 5, 0] = 0.0
    assert called(limits, rows) == {}


def test_a_reading_at_the_end_of_its_range_is_clipped_not_held(limits):
    rows = healthy(13)
    rows[1500:, 1] = np.minimum(rows[1500:, 1], 0.1)
    rows[2000:, 1] = 0.1
    assert "actuator_position_stuck" in called(limits, rows)
    tests = SensorTests(limits, CHANNELS, FLEA, period_s=0.01, counts=FLEA_COUNTS)
    tests.bound("actuator_position", 0.0, 0.1)
    z = tests.step(rows).z
    assert z[:, NAMES.index("actuator_position_stuck")].max() < 10


@pytest.mark.parametrize(("column", "added"), [(0, 0.6), (1, 5e-4), (2, 2.0)])
def test_added_noise_is_called_within_four_seconds(limits, column, added):
    rows = healthy(14)
    rows[1500:, column] += added * np.random.default_rng(3).standard_normal(1500)
    found = called(limits, rows)
    assert 1500 < found[f"{CHANNELS[column]}_noise"] < 1900


def test_an_outlier_of_a_position_is_withheld_and_no_step(limits):
    for width in (1, 2):
        rows = healthy(18)
        rows[1500 : 1500 + width, 1] += 0.02
        assert called(limits, rows) == {}
        assert np.isnan(run(limits, rows, 50)[0][1500 : 1500 + width, 1]).all()


def test_spikes_are_no_noise_and_a_unit_that_was_always_louder_is_none(limits):
    rows = healthy(15)
    rows[::50, 2] += 10.0
    assert called(limits, rows) == {}
    louder = healthy(16)
    louder[:, 2] = 25.0 + 2.0 * (louder[:, 2] - 25.0)
    assert called(limits, louder[600:]) == {}
    louder[1500:, 2] = 25.0 + 4.0 * (louder[1500:, 2] - 25.0)
    assert 1500 < called(limits, louder)["motor_temperature_noise"] < 2000


@pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="numba is an extra")
def test_compiled_loops_give_the_bits_of_numpy(limits):
    rows = healthy(21)
    rows[1500:, 0] += 0.6 * np.random.default_rng(3).standard_normal(1500)
    rows[2000:, 2] = 25.0
    rows[np.random.default_rng(4).random(rows.shape) < 0.01] = np.nan
    noise = [NAMES.index(f"{channel}_noise") for channel in CHANNELS]
    results = []
    for backend, block in (("numpy", 700), ("numba", 700), ("numba", 1)):
        tests = SensorTests(limits, CHANNELS, FLEA, backend, period_s=0.01, counts=FLEA_COUNTS)
        parts = [tests.step(rows[k : k + block]).z[:, noise] for k in range(0, SCANS, block)]
        results.append(np.concatenate(parts))
    assert (np.abs(results[0]) > 1.0).any(axis=0)[[0, 2]].all()
    np.testing.assert_array_equal(results[1], results[0])
    np.testing.assert_array_equal(results[2], results[0])


@pytest.mark.parametrize("size", [0.001, -0.001, 0.006, -0.02])
def test_a_biased_position_steps(limits, size):
    rows = healthy(17)
    rows[1500:, 1] += size
    found = called(limits, rows)
    assert list(found) == ["actuator_position"]
    assert found["actuator_position"] == pytest.approx(1507, abs=5)
    _, z, _ = run(limits, rows, 50)
    limit = next(entry for entry in limits if entry.channel == "actuator_position")
    largest = z[1500:1520, 0][np.nanargmax(np.abs(z[1500:1520, 0]))] * limit.step
    assert largest == pytest.approx(size, rel=0.25)


def test_limits_say_what_the_recordings_show(limits):
    by_name = {limit.channel: limit for limit in limits}
    assert set(by_name) == set(CHANNELS)
    position = by_name["actuator_position"]
    # 0.5 Hz, 30 mm: 0.94 mm a scan at most, the difference of two readings' noise, twice the sum.
    assert 2 * 0.94e-3 < position.reach < 2 * (0.94e-3 + 4 * 2**0.5 * 6e-5)
    assert 2 <= position.repeats <= 6
    assert by_name["motor_current"].step == 0.0
    assert position.loudest == pytest.approx(math.log(6e-5) - 0.635, abs=0.35)
    assert read_as(SensorLimit, position.to_mapping()) == position


@pytest.mark.parametrize(
    ("key", "value"), [("reach", math.nan), ("channel", 7), ("k", -1.0), ("k", "5")]
)
def test_a_spoilt_limit_is_refused_by_name(limits, key, value):
    with pytest.raises(ConfigurationError, match=f"^{key} = "):
        read_as(SensorLimit, {**limits[0].to_mapping(), key: value})
    with pytest.raises(ConfigurationError, match="is missing; give it"):
        read_as(SensorLimit, {key: value})


def test_every_test_names_its_channel():
    assert FLEA.channel_of("actuator_position") == "actuator_position"
    assert FLEA.channel_of("motor_temperature_dropout") == "motor_temperature"


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 700, SCANS])
def test_compiled_gives_the_bits_of_numpy(block):
    """Two positions that move together, step, are held, clipped or missing."""
    pytest.importorskip("numba")
    names = ("motor_speed", "actuator_position", "load_position")

    def recording(seed: int) -> np.ndarray:
        found = encoded(seed)
        return np.column_stack(
            (found, found[:, 1] + 4e-6 * np.random.default_rng(seed).integers(-9, 9, SCANS))
        )

    runs = [dict(zip(names, recording(seed).T, strict=True)) for seed in range(8)]
    learned = sensor_limits(runs, FLEA, 0.1, 0.01)
    rows = recording(20)
    rows[800:, 1] += 0.01
    rows[1200:, 1:] += 0.004
    rows[1500:1560, 2] = rows[1500, 2]
    rows[2000:2010, 1] = math.nan
    tests = [
        SensorTests(learned, names, FLEA, backend, period_s=0.01, counts=FLEA_COUNTS)
        for backend in ("numpy", "numba")
    ]
    stepped = 0
    for test in tests:
        test.bound("load_position", 0.0, 0.07)
    for start in range(0, SCANS, block):
        one, other = (test.step(rows[start : start + block]) for test in tests)
        assert one.usable.tobytes() == other.usable.tobytes()
        assert np.array_equal(one.z, other.z, equal_nan=True)
        stepped += int((np.abs(one.z[:, 0]) > one.k[0]).sum())
    assert stepped > 0
    assert tests[0].stuck == tests[1].stuck != dict.fromkeys(names, 0)


def test_noise_below_the_resolution_is_no_measure_of_how_it_scatters() -> None:
    # Healthy recordings of a fine encoder hold no sample above its resolution.
    quiet = SensorLimit("motor_speed", math.log(0.5), math.log(0.5), 1e-6, 0, 100.0, 0.0, 5.4)
    test = NoiseTest([quiet], FLEA, "numpy")
    random = np.random.default_rng(5)
    test.step(np.zeros((WARM_UP_SCANS + 3, 1)))
    hardly = test.step(0.6 * random.normal(size=(400, 1)))
    loud = test.step(6.0 * random.normal(size=(400, 1)))
    assert np.abs(hardly).max() < 5.4 < loud.max()


def test_other_channels_are_tested_by_their_described_noise_and_a_loop_hides_no_step():
    rows = compiled_relations(WING).residuals
    found = rows.sensors
    assert found.resolutions["surface_angle"] == pytest.approx(2e-4 / 50.0)
    assert list(found.positions) == ["actuator_position"]
    assert found.positions["actuator_position"] == pytest.approx(1e-4)
    assert "motor_voltage" not in found.resolutions
    assert {"surface_angle_noise", "surface_angle_stuck"} <= set(rows.place)
    assert "surface_angle" not in rows.place
    assert not found.paired
    assert FLEA.paired


@pytest.mark.parametrize("block", [1, 7, 500])
def test_when_the_actuator_runs_away_no_sensor_is_blamed_until_a_window_after_it(limits, block):
    """Faster than in any recording into its stop, with what the impact shakes."""
    rows, shaken = healthy(31), 1.0 + 9.0 * (np.abs(np.arange(SCANS) - 1065) <= 50)
    loud = np.random.default_rng(5).standard_normal(SCANS) * SIGMA[0] * shaken
    rows[:, 0] += loud
    away = rows.copy()
    goes = np.interp(np.arange(SCANS), (1000, 1015), (0.0, 0.12))
    away[:, 1] += goes - 0.02 * (goes == 0.12)  # it bounces
    for one, blamed in ((rows, True), (away, False)):
        _, z, k = run(limits, one, block)
        with np.errstate(invalid="ignore"):
            beyond = (np.abs(z) > k).any(axis=0)
        assert beyond[NAMES.index("motor_current_noise")] == blamed
        assert not beyond[NAMES.index("actuator_position")]


def test_it_runs_away_though_another_position_is_held(limits):
    position = next(limit for limit in limits if limit.channel == "actuator_position")
    limits = (*limits, replace(position, channel="load_position"))
    names = (*CHANNELS, "load_position")
    ways = np.zeros((2, 20, 2))
    ways[:, 10:, 0] = np.linspace(0.0, 18.0 * position.reach, 10)
    ways[0, :, 1] = 1e-5 * np.arange(20)  # it moves as ever
    for way, runs in zip(ways, (False, True), strict=True):
        tests = SensorTests(limits, names, FLEA, "numpy", period_s=0.01, counts=FLEA_COUNTS)
        rows = np.zeros((20, len(names)))
        rows[:, [1, -1]] = way
        tests.step(rows)
        assert (tests.away is not None and tests.away.any()) == runs


def test_an_outlier_of_a_current_is_withheld_as_if_it_were_lost(limits):
    rows = healthy(22)
    rows[1500, 0] += 10.0
    tests = SensorTests(limits, CHANNELS, FLEA, period_s=0.01, counts=FLEA_COUNTS)
    for first in range(0, 1450, 50):
        tests.step(rows[first : first + 50])
        assert tests.outlying is None
    tests.step(rows[1450:1500])
    usable = tests.step(rows[1500:1550]).usable
    assert np.argwhere(np.isnan(usable)).tolist() == [[0, 0]]
    assert np.argwhere(tests.outlying).tolist() == [[0, 0]]


@pytest.mark.parametrize("turns", [True, False])
def test_a_way_that_the_motor_has_turned_is_no_step_of_a_position(turns):
    """Faster than any healthy motion for two scans, as where a load drives an open motor."""
    fine = {"actuator_position": 1e-6, "motor_speed": 0.5}
    sensors = SensorSet(fine, {"actuator_position": 1e-4}, "motor_speed")
    draw, way = np.random.default_rng(23), 1e-5
    speed = 50.0 * np.sin(2.0 * np.pi * 0.5 * TIME)
    limits = (
        SensorLimit("actuator_position", -13.0, -11.0, 1.0, 0, 1e-2, 1e-4, 5.0),
        SensorLimit("motor_speed", -2.0, 0.0, 1.0, 0, 500.0, 0.0, 5.0),
    )
    speed[1500:1501] += 60.0
    position = way * np.cumsum(speed) + 1e-6 * draw.standard_normal(SCANS)
    if not turns:
        position[1500:] += 1e-3
    rows = np.stack((position, speed + 0.1 * draw.standard_normal(SCANS)), axis=1)
    tests = SensorTests(
        limits,
        tuple(fine),
        sensors,
        period_s=0.01,
        counts=FLEA_COUNTS,
        turned=("actuator_position", way),
    )
    steps = tests.step(rows).z[:, sensors.names.index("actuator_position")]
    assert bool(np.nanmax(np.abs(steps)) > 1.0) is not turns
