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

"""Amplitude of impacts at a ball-pass line: a condition indicator that grows with a pit.

An impact of amplitude a rings with an envelope in proportion to a, and its square with a^2. The
noise of a healthy drive adds a floor to the spectrum of the squared envelope, and nothing to its
line. So the square of the line, less the floor, goes with a^4 from the first impact on, where the
line of the envelope itself goes with a^2 at first and with a later. Stretches and orders are those
of the other order-tracked features.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from flea_diag.core.vibration.features_envelope import (
    BINS_PER_REVOLUTION,
    by_angle,
    envelope,
    line_and_surroundings,
    padded,
    stretches,
    transformed,
)
from flea_diag.core.vibration.window import Floats, Window, shared


def line_impacts(line: str) -> Callable[[Window], Floats]:
    """Feature: amplitude of impacts at one line, m/s^2; below 0 where noise lowers the line."""

    def feature(window: Window) -> Floats:
        order, parts = window.order(line), _spectra(window)
        squares = [_square(power, orders, order) for orders, power, _ in parts]
        lengths = [length for _, _, length in parts]
        square = float(np.average(squares, weights=lengths))
        return np.asarray(math.copysign(abs(square) ** 0.25, square))

    feature.__doc__ = (
        f"Amplitude of impacts at the {line} order, m/s^2: from the line of the squared envelope "
        "above its floor; in proportion to their strength, not to their number."
    )
    return feature


@shared
def _spectra(window: Window) -> list[tuple[Floats, Floats, int]]:
    """Of each stretch: orders, squares of a line's bins of each axis, and its length."""
    rows = np.square(envelope(window), dtype=np.float64)
    found: list[tuple[Floats, Floats, int]] = []
    for start, stop in stretches(window):
        by_bin = by_angle(rows, window, start, stop, BINS_PER_REVOLUTION)
        length = by_bin.shape[1]
        size = padded(length)
        spectrum, weight = transformed(by_bin, size)
        # The bins of a line add up to the square of its amplitude (Parseval).
        scale = 4.0 / (size * float(weight @ weight))
        power = scale * np.square(np.abs(spectrum))
        found.append((np.fft.rfftfreq(size, 1.0 / BINS_PER_REVOLUTION), power, length))
    return found


def _square(power: Floats, orders: Floats, order: float) -> float:
    on_line, around = line_and_surroundings(orders, order)
    # Bins of noise are exponential: their mean by their median, which another line hardly moves.
    floors = np.median(power[:, around], axis=1, keepdims=True) / math.log(2.0)
    return float((power[:, on_line] - floors).sum())
