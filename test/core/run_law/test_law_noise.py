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

import numpy as np
import pytest

from flea_diag.core.run_law.law_noise import BOUND, LawNoise, calibrated, learned_noise
from flea_diag.core.run_law.run_windows import RunWindows


def coloured(rng: np.random.Generator, windows: int, phi: float = 0.7) -> np.ndarray:
    """A first-order process of variance 1."""
    made = np.empty(windows)
    made[0] = rng.standard_normal()
    for k in range(1, windows):
        made[k] = phi * made[k - 1] + np.sqrt(1.0 - phi**2) * rng.standard_normal()
    return made


def run_of(values: np.ndarray, turning: np.ndarray | None = None) -> RunWindows:
    still = np.zeros(len(values), dtype=bool)
    signals = np.zeros((*values.shape, 1))
    return RunWindows("run", "", values, signals, still if turning is None else turning)


def quiet(**given) -> LawNoise:
    one = np.ones(2)
    plain = {"white": one, "coloured": 0.0 * one, "phi": 0.3 * one, "turning": one}
    return LawNoise(**{**plain, "shared": np.zeros((2, 2)), **given})


def test_learned_noise_whitens_what_it_was_learned_from():
    rng = np.random.default_rng(1)
    left = [
        np.column_stack((
            2.0 * coloured(rng, 400) + rng.standard_normal(400), 0.1 * rng.standard_normal(400)
        ))
        for _ in range(10)
    ]  # fmt: skip
    noise = learned_noise(left, ())
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
    noise = learned_noise([left], [(1, 0)])
    assert noise.shared[1, 0] == pytest.approx(0.5, abs=0.02)
    assert noise.sigma == pytest.approx([1.0, 0.1], rel=0.1)


def test_a_spike_counts_as_if_it_were_no_farther_out_than_the_bound():
    values = np.zeros((20, 2))
    values[7, 0] = 50.0
    white = quiet().whitened(run_of(values), np.zeros((20, 2, 0))).bounded(np.zeros(0))
    assert np.square(white.rows[7, 0, 0]) == pytest.approx(BOUND * 50.0)


def test_windows_with_a_reversal_may_be_louder():
    rng = np.random.default_rng(4)
    turning = np.arange(2000) % 4 == 0
    values = rng.standard_normal((2000, 2)) * np.where(turning, 3.0, 1.0)[:, None]
    noise = calibrated(quiet(), [values], [np.ones((2000, 2), dtype=bool)], [turning], np.zeros(2))
    # What is far out is bounded, so the factor comes out a little smaller.
    assert (noise.turning > 1.8).all()
    white = noise.whitened(run_of(values, turning), np.zeros((2000, 2, 0))).rows[..., 0]
    assert white[~turning].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.1)
