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

"""Condition indicators in the time domain: amplitude and shape of one accelerometer.

Every function takes a `Window` and returns one value per axis, shape (axes,).
"""

from __future__ import annotations

import numpy as np

from flea_diag.core.vibration.window import Floats, NotComputableError, Window


def std(window: Window) -> Floats:
    """Root mean square about the mean, sqrt(mean((x - mean)^2)), m/s^2: standard deviation.

    The one feature of the founding paper (Narasimhan et al. 2010, section 4.2).
    """
    return window.std


def rms(window: Window) -> Floats:
    """Root mean square, sqrt(mean(x^2)), m/s^2; unlike ``std`` it keeps a sensor's offset."""
    samples = np.asarray(window.samples)
    return np.asarray(np.sqrt(np.einsum("na,na->a", samples, samples) / window.count))


def mean(window: Window) -> Floats:
    """Mean, m/s^2: gravity and the sensor's offset."""
    return np.asarray(np.mean(window.samples, axis=0, dtype=np.float64))


def peak(window: Window) -> Floats:
    """Largest excursion from the mean, max|x - mean|, m/s^2."""
    return np.asarray(np.maximum(window.centred.max(axis=1), -window.centred.min(axis=1)))


def crest(window: Window) -> Floats:
    """Crest factor, peak / std; sqrt(2) for a sine."""
    return peak(window) / _spread(window)


def skewness(window: Window) -> Floats:
    """Third standardised moment, mean(x^3) / std^3; 0 for a symmetric signal."""
    rows = window.centred
    cubes = np.einsum("an,an,an->a", rows, rows, rows)
    return np.asarray(cubes / window.count / _spread(window) ** 3)


def kurtosis(window: Window) -> Floats:
    """Fourth standardised moment, mean(x^4) / std^4; 3 for Gaussian noise, 1.5 for a sine."""
    squares = np.square(window.centred)
    fourth = np.einsum("an,an->a", squares, squares)
    return np.asarray(fourth / window.count / _spread(window) ** 4)


def impulse_factor(window: Window) -> Floats:
    """Peak over mean absolute value; pi/2 for a sine."""
    return peak(window) / _mean_absolute(window)


def shape_factor(window: Window) -> Floats:
    """Ratio of standard deviation to mean absolute value; sqrt(pi/2) for Gaussian noise."""
    return window.std / _mean_absolute(window)


def local_kurtosis(window: Window, block_s: float = 0.02) -> Floats:
    """Median over blocks of 20 ms of the kurtosis within a block.

    A vibration whose level follows the speed has a high kurtosis over the whole window but 3
    within each block; impacts raise the kurtosis within a block.
    """
    squares = np.square(_blocks(window, block_s))
    fourth = np.einsum("abn,abn->ab", squares, squares) / squares.shape[2]
    second = squares.mean(axis=2)
    if not (second > 0.0).all():
        raise NotComputableError("an axis is constant, its moments have no ratio")
    return np.asarray(np.median(fourth / second**2, axis=1))


def intermittence(window: Window, block_s: float = 0.02) -> Floats:
    """Ninth decile over median of the standard deviation of blocks of 20 ms; 1 when steady.

    High for intermittent rubbing or impacts, low for steady friction and for the noise of a
    failing sensor.
    """
    blocks = _blocks(window, block_s)
    levels = np.sqrt(np.einsum("abn,abn->ab", blocks, blocks) / blocks.shape[2])
    median = np.median(levels, axis=1)
    if not (median > 0.0).all():
        raise NotComputableError("an axis is constant: ratio of levels undefined")
    return np.asarray(np.quantile(levels, 0.9, axis=1) / median)


def _blocks(window: Window, block_s: float) -> Floats:
    """Centred rows cut into blocks, shape (axes, blocks, points)."""
    points = round(block_s * window.rate_hz)
    blocks = window.count // points
    if blocks < 4:
        raise NotComputableError(f"window of {window.duration_s:g} s is shorter than 4 blocks")
    rows = window.centred[:, : blocks * points]
    return rows.reshape(len(rows), blocks, points)


def _spread(window: Window) -> Floats:
    """Standard deviation of each axis; refused if an axis is constant."""
    if not (window.std > 0.0).all():
        raise NotComputableError("an axis is constant, its moments have no ratio")
    return window.std


def _mean_absolute(window: Window) -> Floats:
    """Mean of |x - mean|; refused if an axis is constant."""
    _spread(window)
    return np.asarray(np.abs(window.centred).mean(axis=1))
