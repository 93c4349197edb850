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

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flea_diag.core.smoothing import MOST_NOISE, Smoother, gap_kernels, hann_kernels, sliding

LENGTHS = st.integers(2, 30).map(lambda half: 2 * half + 1)
NUMBERS = st.floats(-100.0, 100.0)


def push(smoother: Smoother, *row: float) -> np.ndarray:
    return smoother.push(np.array([row]))[0][0]


def taken(smoother: Smoother, rows: np.ndarray) -> np.ndarray:
    """Smoothed values beside their noise, shape (n, 6, channels)."""
    smooth, noise = smoother.push(rows)
    return np.concatenate((smooth, np.ones_like(smooth) if noise is None else noise), axis=1)


@given(LENGTHS, st.sampled_from((0.001, 0.01, 0.1)), NUMBERS, NUMBERS, NUMBERS)
def test_polynomials_come_out_exactly_at_the_centre(length, period, level, slope, bend):
    t = (np.arange(length) - (length - 1) / 2) * period
    value, first, second = hann_kernels(length, period)
    ramp = level + slope * t
    assert value @ ramp == pytest.approx(level, abs=1e-9)
    assert first @ ramp == pytest.approx(slope, abs=1e-9 / period)
    assert second @ ramp == pytest.approx(0.0, abs=1e-9 / period**2)
    parabola = ramp + 0.5 * bend * t**2
    assert first @ parabola == pytest.approx(slope, abs=1e-9 / period)
    assert second @ parabola == pytest.approx(bend, abs=1e-9 / period**2)


def test_a_slow_sine_keeps_value_and_derivatives_within_the_kernel_bandwidth():
    period, f = 0.01, 0.5
    smoother = Smoother(1, 31, period)
    w = 2 * np.pi * f
    for k in range(400):
        value, first, second = push(smoother, np.sin(w * k * period))[:, 0]
    centre = (399 - 15) * period
    assert value == pytest.approx(np.sin(w * centre), abs=0.03)
    assert first == pytest.approx(w * np.cos(w * centre), abs=0.05 * w)
    assert second == pytest.approx(-(w**2) * np.sin(w * centre), abs=0.05 * w**2)


def test_pwm_is_averaged_to_its_mean():
    pwm = np.where(np.random.default_rng(1).random(3000) < 0.7, 24.0, 0.0)
    smoother = Smoother(1, 31, 0.01)
    means = smoother.push(pwm[:, None])[0][31:, 0, 0]
    # Effective length of a Hann window: (sum k)^2 / sum k^2 = 2/3 of 32 samples.
    assert np.mean(means) == pytest.approx(0.7 * 24.0, abs=0.6)
    assert np.std(means) == pytest.approx(24.0 * np.sqrt(0.21 / (32 * 2 / 3)), rel=0.15)


def test_a_gap_stays_in_its_channel_and_leaves_with_the_window():
    smoother = Smoother(2, 7, 0.01)
    out = [push(smoother, 1.0, np.nan if 20 <= k < 24 else 2.0) for k in range(40)]
    assert np.isnan(out[5]).all()
    assert np.isfinite(np.array(out[6:])[:, :, 0]).all()
    bad = [k for k in range(6, 40) if np.isnan(out[k][0, 1])]
    assert set(bad) < set(range(20, 30))
    assert bad == list(range(bad[0], bad[-1] + 1))
    smoother.clear()
    assert np.isnan(push(smoother, 1.0, 1.0)).all()


def test_what_lies_before_the_first_row_is_no_gap():
    smoother = Smoother(1, 31, 0.01)
    assert np.isnan([push(smoother, float(k)) for k in range(30)]).all()
    assert np.isfinite(push(smoother, 30.0)).all()


def test_nothing_is_said_across_a_reading_that_was_refused():
    rows = np.ones((80, 1))
    rows[40] = np.nan
    bridged, barred = Smoother(1, 31, 0.01), Smoother(1, 31, 0.01)
    assert np.isfinite(bridged.push(rows)[0][30:]).all()
    found = [
        barred.push(row[None], np.isnan(row[None]) & (k == 40))[0] for k, row in enumerate(rows)
    ]
    gone = [k for k in range(30, 80) if np.isnan(found[k]).any()]
    assert gone == list(range(40, 71))
    some = Smoother(1, 31, 0.01)
    blocks = [some.push(part, np.isnan(part))[0] for part in np.split(rows, [41])]
    np.testing.assert_array_equal(np.concatenate(blocks), np.concatenate(found))


@given(st.integers(0, 2**31 - 1).filter(lambda bits: bin(bits).count("1") < 29), NUMBERS, NUMBERS)
def test_a_ramp_comes_out_exactly_over_any_gap_that_is_bridged(bits, level, slope):
    lost = np.array([bits >> k & 1 for k in range(31)], dtype=bool)
    kernels, noise = gap_kernels(lost.tobytes(), 0.01)
    if np.isnan(kernels).any():
        assert noise.max() > MOST_NOISE
        return
    ramp = level + slope * (np.arange(31) - 15) * 0.01
    assert not kernels[:, lost].any()
    assert kernels @ ramp == pytest.approx([level, slope, 0.0], abs=1e-5)


def test_the_noise_of_a_bridged_value_is_that_of_its_readings():
    rows = np.random.default_rng(2).standard_normal((40_000, 2))
    rows[1::2, 1] = np.nan
    smooth, noise = Smoother(2, 31, 0.01).push(rows)
    assert noise is not None
    assert (noise[31:, :, 0] == 1.0).all()
    ratio = smooth[31:, :, 1].std(axis=0) / smooth[31:, :, 0].std(axis=0)
    assert ratio == pytest.approx(noise[31:, :, 1].mean(axis=0), rel=0.05)


def test_a_motion_is_known_at_half_the_readings():
    t = np.arange(400) * 0.01
    rows = np.stack([np.sin(np.pi * t), np.sin(np.pi * t)], axis=1)
    rows[::2, 1] = np.nan
    smooth, _ = Smoother(2, 31, 0.01).push(rows)
    scale = np.abs(smooth[40:, :, 0]).max(axis=0)
    assert (np.abs(smooth[40:, :, 1] - smooth[40:, :, 0]) < 0.01 * scale).all()


@given(st.lists(NUMBERS, min_size=5, max_size=60))
def test_streaming_is_the_correlation_with_the_kernels(values):
    smoother, kernels = Smoother(1, 5, 0.01), hann_kernels(5, 0.01)
    streamed = [push(smoother, v)[:, 0] for v in values][4:]
    whole = [np.correlate(values, kernel, mode="valid") for kernel in kernels]
    np.testing.assert_allclose(streamed, np.transpose(whole), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("length", [4, 30, 3, 1, 0])
def test_kernels_without_a_centre_or_too_short_are_refused(length):
    with pytest.raises(ValueError, match=f"kernel length {length} must be odd and at least 5"):
        hann_kernels(length, 0.01)


@given(st.lists(st.integers(1, 40), min_size=1, max_size=8))
def test_blocks_give_the_bits_of_their_rows(lengths):
    rows = np.random.default_rng(1).standard_normal((sum(lengths), 10))
    rows[::17, 3], rows[::2, 4], rows[:, 5] = np.nan, np.nan, np.nan
    one, many = Smoother(10, 31, 0.01), Smoother(10, 31, 0.01)
    single = [taken(one, row[None]) for row in rows]
    blocks = [taken(many, part) for part in np.split(rows, np.cumsum(lengths)[:-1])]
    np.testing.assert_array_equal(np.concatenate(blocks), np.concatenate(single))


def test_sliding_windows_are_those_of_numpy():
    rows = np.arange(24.0).reshape(8, 3)
    expected = np.lib.stride_tricks.sliding_window_view(rows, 5, axis=0).transpose(0, 2, 1)
    np.testing.assert_array_equal(sliding(rows, 5), expected)
