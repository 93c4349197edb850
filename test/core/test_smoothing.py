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

from flea_diag.core.smoothing import Smoother, hann_kernels, sliding

LENGTHS = st.integers(2, 30).map(lambda half: 2 * half + 1)
NUMBERS = st.floats(-100.0, 100.0)


def push(smoother: Smoother, *row: float) -> np.ndarray:
    return smoother.push(np.array([row]))[1][0]


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
    means = smoother.push(pwm[:, None])[1][31:, 0, 0]
    # Effective length of a Hann window: (sum k)^2 / sum k^2 = 2/3 of 32 samples.
    assert np.mean(means) == pytest.approx(0.7 * 24.0, abs=0.6)
    assert np.std(means) == pytest.approx(24.0 * np.sqrt(0.21 / (32 * 2 / 3)), rel=0.15)


def test_nan_stays_in_its_channel_and_leaves_with_the_window():
    smoother = Smoother(2, 7, 0.01)
    out = [push(smoother, 1.0, np.nan if k == 20 else 2.0) for k in range(40)]
    assert np.isnan(out[5]).all()
    assert np.isfinite(np.array(out[6:])[:, :, 0]).all()
    bad = [k for k in range(6, 40) if np.isnan(out[k][0, 1])]
    assert bad == list(range(20, 27))
    smoother.clear()
    assert np.isnan(push(smoother, 1.0, 1.0)).all()


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
    rows[::17, 3] = np.nan
    one, many = Smoother(10, 31, 0.01), Smoother(10, 31, 0.01)
    single = np.concatenate([one.push(row[None])[1] for row in rows])
    blocks = np.split(rows, np.cumsum(lengths)[:-1])
    np.testing.assert_array_equal(np.concatenate([many.push(b)[1] for b in blocks]), single)


def test_sliding_windows_are_those_of_numpy():
    rows = np.arange(24.0).reshape(8, 3)
    expected = np.lib.stride_tricks.sliding_window_view(rows, 5, axis=0).transpose(0, 2, 1)
    np.testing.assert_array_equal(sliding(rows, 5), expected)
