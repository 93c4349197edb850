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

"""Noise of relations: what is whitened is white, what is far out counts less."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flea_diag.configuration.calibrations import law_of
from flea_diag.configuration.stand import load_stand
from flea_diag.core import backend as backends
from flea_diag.core.run_law.law_noise import BOUND, LASTING, LawNoise, calibrated, learned_noise
from flea_diag.core.run_law.motion_noise import ANY_MOTION, with_rest
from flea_diag.core.run_law.run_windows import (
    BY_PLACE,
    CURRENT_WAY,
    CURRENT_ZERO,
    FORMED,
    HEATING_S,
    MOTIONS,
    RunWindows,
    WindowMotion,
    along,
    left_out,
    losses,
)


def coloured(rng: np.random.Generator, windows: int, phi: float = 0.7) -> np.ndarray:
    """A first-order process of variance 1."""
    made = np.empty(windows)
    made[0] = rng.standard_normal()
    for k in range(1, windows):
        made[k] = phi * made[k - 1] + np.sqrt(1.0 - phi**2) * rng.standard_normal()
    return made


def run_of(values: np.ndarray, motion: np.ndarray | None = None) -> RunWindows:
    still = np.zeros((len(values), len(MOTIONS)))
    signals = np.zeros((*values.shape, 1))
    return RunWindows("run", "", values, signals, still if motion is None else motion)


def quiet(**given) -> LawNoise:
    one = np.ones(2)
    plain = {"white": one, "coloured": 0.0 * one, "phi": 0.3 * one}
    none = np.zeros((2, 2))
    every = {"shared": none, "by_slope": none, "motion": np.tile(ANY_MOTION, (2, 1))}
    return LawNoise(**{**plain, **every, **given})


def test_learned_noise_whitens_what_it_was_learned_from():
    rng = np.random.default_rng(1)
    left = [
        np.column_stack((
            2.0 * coloured(rng, 400) + rng.standard_normal(400), 0.1 * rng.standard_normal(400)
        ))
        for _ in range(10)
    ]  # fmt: skip
    noise = learned_noise(left, (), ())
    assert noise.sigma == pytest.approx([np.sqrt(5.0), 0.1], rel=0.1)
    white = np.concatenate([
        noise.whitened(run_of(entry), np.zeros((400, 2, 0))).rows[..., 0] for entry in left
    ])  # fmt: skip
    assert white.std(axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    lagged = (white[1:] * white[:-1]).mean(axis=0)
    assert np.abs(lagged).max() < 0.06


def test_the_log_density_of_white_noise_is_that_of_the_normal_distribution():
    values = np.random.default_rng(2).standard_normal((30, 2)) * [3.0, 0.5]
    values[4, 1] = np.nan
    noise = quiet(white=np.array([9.0, 0.25]))
    white = noise.whitened(run_of(values), np.zeros((30, 2, 0)))
    found = white.log_scale - 0.5 * np.square(white.rows).sum()
    known = np.isfinite(values)
    z = values / np.array([3.0, 0.5])
    assert found == pytest.approx((-0.5 * z**2 - np.log([3.0, 0.5]))[known].sum())


def test_what_two_relations_share_is_taken_off_the_later_one():
    rng = np.random.default_rng(3)
    common = rng.standard_normal(3000)
    left = np.column_stack((common, 0.5 * common + 0.1 * rng.standard_normal(3000)))
    noise = learned_noise([left], [(1, 0)], [np.zeros((3000, 2, len(FORMED)))])
    assert noise.shared[1, 0] == pytest.approx(0.5, abs=0.02)
    assert not noise.by_slope.any()
    assert noise.sigma == pytest.approx([1.0, 0.1], rel=0.1)


def test_near_no_current_a_bridge_takes_the_noise_of_the_current_by_the_slope_of_its_sign():
    rng = np.random.default_rng(4)
    slope, drop, rest = rng.uniform(0.0, 1.0, 6000), 0.5, rng.random(6000) < 0.5
    balance, circuit = rng.standard_normal(6000), rng.standard_normal(6000)
    bridge = -drop * slope * circuit + 0.1 * rng.standard_normal(6000)
    left = np.column_stack((np.where(rest, np.nan, balance), circuit, bridge))
    signals = np.zeros((6000, 3, len(FORMED)))
    signals[..., FORMED.index(CURRENT_ZERO)] = slope[:, None]
    noise = learned_noise([left], [(2, 0), (2, 1)], [signals])
    assert noise.shared[2, 1] + noise.by_slope[2, 1] == pytest.approx(-drop, abs=0.02)
    run = RunWindows("run", "", left, signals, np.zeros((6000, len(MOTIONS))))
    white = noise.whitened(run, np.zeros((6000, 3, 0))).rows[..., 0]
    near = slope > 0.8
    assert abs(np.corrcoef(white[near, 1], white[near, 2])[0, 1]) < 0.1
    assert white[near, 2].std() == pytest.approx(1.0, abs=0.1)


def test_a_spike_counts_as_if_it_were_no_farther_out_than_the_bound():
    values = np.zeros((20, 2))
    values[7, 0] = 50.0
    white = quiet().whitened(run_of(values), np.zeros((20, 2, 0))).bounded(np.zeros(0))
    assert np.square(white.rows[7, 0, 0]) == pytest.approx(BOUND * 50.0)


def test_the_noise_grows_with_the_motion():
    rng = np.random.default_rng(4)
    motion = np.square(rng.standard_normal((4000, len(MOTIONS))))
    motion[:, 0] = motion[:, 0] > 2.0
    shares = np.array([[0.5, 3.0, 0.0, 0.0, 0.2, 0.0], [0.2, 0.0, 0.0, 0.0, 0.0, 4.0]])
    values = rng.standard_normal((4000, 2)) * np.sqrt(with_rest(motion) @ shares.T)
    known = np.ones((4000, 2), dtype=bool)
    noise = calibrated(quiet(), [values], [known], [motion], np.zeros(2))
    found = noise.motion * np.square(noise.sigma)[:, None]
    np.testing.assert_allclose(found, shares, rtol=0.15, atol=0.1)
    white = noise.whitened(run_of(values, motion), np.zeros((4000, 2, 0))).rows[..., 0]
    for some in (motion[:, 0] == 0.0, motion[:, 3] > 1.0, motion[:, 4] > 1.0, motion[:, 4] < 0.1):
        assert white[some].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.1)


def test_of_few_windows_the_noise_is_the_same_in_every_motion():
    rng = np.random.default_rng(5)
    motion = np.square(rng.standard_normal((100, len(MOTIONS))))
    values, known = rng.standard_normal((100, 2)), np.ones((100, 2), dtype=bool)
    noise = calibrated(quiet(), [values], [known], [motion], np.zeros(2))
    np.testing.assert_array_equal(noise.motion, np.tile(ANY_MOTION, (2, 1)))


def test_what_adds_up_counts_as_much_as_it_adds_up_to():
    """The second relation is left with a correlation that its filter does not know."""
    rng = np.random.default_rng(6)
    values = [np.column_stack((rng.standard_normal(150), coloured(rng, 150))) for _ in range(40)]
    known, motion = np.ones((150, 2), dtype=bool), np.zeros((150, len(MOTIONS)))
    noise = calibrated(quiet(), values, [known] * 40, [motion] * 40, np.zeros(2))
    sums = {
        n: np.concatenate([v.reshape(-1, n, 2).sum(axis=1) for v in values])[:, 1] for n in LASTING
    }
    # Less one standard error of each.
    lasting = max(
        each.std() / np.sqrt(n * (1.0 + np.sqrt(2.0 / len(each)))) for n, each in sums.items()
    )
    assert noise.sigma[0] == pytest.approx(1.0, abs=0.1)
    assert noise.sigma[1] == pytest.approx(lasting, abs=0.1)
    assert noise.sigma[1] > 1.8


def test_places_along_the_stroke_are_told_by_the_healthy_travel():
    places = np.array([0.02, 0.05, 0.08, 0.2, math.nan])
    np.testing.assert_allclose(along(places, (0.02, 0.08)), [-1.0, 0.0, 1.0, 1.0, 0.0], atol=1e-12)
    assert not along(places, ()).any()
    assert not along(places, (0.05, 0.05)).any()


def test_over_the_travel_what_changes_along_it_looks_like_no_load_and_no_way():
    place, load = np.linspace(-1.0, 1.0, 2001), np.full(2001, 300.0)
    none, way = 0.0 * place, np.ones(2001)
    columns = left_out(none, none, none, load, way, place)[:, FORMED.index(BY_PLACE[0]) :]
    assert columns.shape == (2001, 6)
    assert np.abs(columns.mean(axis=0) / np.abs(columns).max(axis=0)).max() < 1e-3


def test_a_bridge_loses_its_voltage_by_the_way_of_the_current():
    current, none = np.array([-2.0, 0.0, 0.1]), np.zeros(3)
    columns = left_out(current, none, none, none, none, none)
    assert columns.shape == (3, len(FORMED))
    assert columns[:, FORMED.index(CURRENT_WAY)].tolist() == [-1.0, 0.0, 1.0]


def test_losses_warm_a_winding_and_fade_whatever_the_blocks():
    current = np.concatenate((np.full(3000, 2.0), np.zeros(6000)))
    whole = losses(current, 0.0, 0.01)
    first = losses(current[:1234], 0.0, 0.01)
    later = losses(current[1234:], float(first[-1]), 0.01)
    assert np.array_equal(whole, np.concatenate((first, later)))
    assert whole[2999] == pytest.approx(
        4.0 * HEATING_S * (1.0 - math.exp(-30.0 / HEATING_S)), rel=1e-3
    )
    assert whole[-1] == pytest.approx(whole[2999] * math.exp(-60.0 / HEATING_S), rel=1e-3)
    assert np.array_equal(losses(np.array([math.nan, 1.0]), 0.0, 0.01), [0.0, 0.01])
    if backends.chosen("auto") == "numba":
        assert losses(current, 0.3, 0.01, compiled=True).tobytes() == (
            losses(current, 0.3, 0.01).tobytes()
        )


def test_how_a_machine_moves_is_told_from_window_to_window():
    speed = np.repeat([0.0, 0.0, 2.0, 3.0], 5)
    direction = np.repeat([0.0, 0.0, 1.0, 1.0], 5)
    load = np.repeat([0.0, 7.0, 0.0, 0.0], 5)
    scans = [each.reshape(4, 5) for each in (direction, load, speed)]
    told = [[1, 0, 0, 0, 0], [1, 49, 0, 0, 0], [0, 0, 4, 4, 4], [0, 0, 9, 1, 1]]
    np.testing.assert_array_equal(WindowMotion().steps(*scans), told)
    moves = WindowMotion()
    one_by_one = [moves.steps(*(each[k : k + 1] for each in scans)) for k in range(4)]
    np.testing.assert_array_equal(np.concatenate(one_by_one), told)
    assert np.isfinite(WindowMotion().steps(*np.full((3, 2, 5), np.nan))).all()


def test_a_balance_of_power_holds_a_push_that_no_channel_reads():
    stand = load_stand("cranfield")
    assert "parity_power: d_actuator_position" in [t.name for t in law_of(stand).terms]
