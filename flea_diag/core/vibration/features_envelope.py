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

"""Condition indicators from the envelope and from orders of the shaft.

Impacts excite a resonance; the envelope of that band repeats at the rate of the impacts
(McFadden and Smith 1984). The rate is proportional to shaft speed, so spectra are taken over
shaft angle instead of time, and a reciprocating motion is divided at its reversals.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.window import Floats, NotComputableError, Window, shared

Flags = npt.NDArray[np.bool_]

ENVELOPE_BAND_HZ = (1500.0, 9500.0)  # the FLEA's, assumption
BINS_PER_REVOLUTION = 64  # assumption: orders up to 32
SLOWEST_RAD_S = 10.0
"""Below this speed impacts are too weak and too rare to be used."""

ORDER_TOLERANCE = 0.03
"""Slip of the balls and error of the kinematics, relative to the order."""

FEWEST_REVOLUTIONS = 2.0  # an order has to repeat
SURROUNDINGS = 0.3
"""Distance from a line, relative to it, up to which its surroundings go."""
SMALLEST_LINE = 4.0
"""A line is named only if it exceeds its surroundings by this ratio of amplitudes."""


def envelope(window: Window, band_hz: tuple[float, float] = ENVELOPE_BAND_HZ) -> Floats:
    """Magnitude of the analytic signal of a band, shape (axes, n), m/s^2."""
    from scipy import fft

    # What is left of the band at a low rate shows the impacts as well.
    inside = window.band(band_hz[0], min(band_hz[1], 0.5 * window.rate_hz))
    analytic = np.zeros((len(window.axes), window.count), dtype=np.complex64)
    analytic[:, : window.spectrum.shape[1]][:, inside] = 2.0 * window.spectrum[:, inside]
    return np.asarray(np.abs(fft.ifft(analytic, axis=1, overwrite_x=True)))


def order_spectrum(
    rows: Floats, window: Window, per_revolution: int = BINS_PER_REVOLUTION
) -> tuple[Floats, Floats]:
    """Orders (bins,) and amplitudes (axes, bins) of ``rows`` over travelled shaft angle.

    Each stretch of one direction is averaged into bins of angle, weighted with a Hann window
    and transformed on a common grid of orders; powers are averaged weighted by length.
    """
    parts = [
        by_angle(rows, window, start, stop, per_revolution) for start, stop in stretches(window)
    ]
    size = padded(max(stretch.shape[1] for stretch in parts))
    power = np.zeros((len(rows), size // 2 + 1))
    for stretch in parts:
        spectrum, weight = transformed(stretch, size)
        power += np.square(np.abs(spectrum * (2.0 / weight.sum()))) * stretch.shape[1]
    power /= sum(stretch.shape[1] for stretch in parts)
    return np.fft.rfftfreq(size, 1.0 / per_revolution), np.sqrt(power)


def padded(bins: int) -> int:
    """Bins to which a stretch is padded: a power of two, at least twice as many."""
    return int(2 ** int(np.ceil(np.log2(2 * bins))))


def transformed(stretch: Floats, size: int) -> tuple[npt.NDArray[np.complex128], Floats]:
    """Spectrum of a stretch, shape (axes, bins), padded to ``size``, and its Hann window."""
    weight = np.hanning(stretch.shape[1] + 2)[1:-1]
    return np.fft.rfft(stretch * weight, size, axis=1), weight


def order_amplitude(order: float) -> Callable[[Window], Floats]:
    """Feature: amplitude of the acceleration at a fixed multiple of the shaft speed, m/s^2."""

    def feature(window: Window) -> Floats:
        orders, amplitude = order_spectrum(window.centred, window)
        near = np.abs(orders - order) <= max(ORDER_TOLERANCE * order, orders[1])
        return np.asarray(amplitude[:, near].max(axis=1))

    feature.__doc__ = f"Amplitude at {order:g} times the shaft speed, m/s^2: unbalance at 1."
    return feature


def line_ratio(line: str) -> Callable[[Window], Floats]:
    """Feature: height of a ball-pass line of the envelope over its surroundings, a ratio."""

    def feature(window: Window) -> Floats:
        window.order(line)
        orders, amplitude = _envelope_orders(window)
        return _over_surroundings(orders, amplitude, window.order(line))

    feature.__doc__ = (
        f"Envelope line at the {line} order over the median of its surroundings, a ratio of "
        "amplitudes; order-tracked by motor speed (Randall and Antoni 2011)."
    )
    return feature


def mesh_ratio(window: Window) -> Floats:
    """Line of the gear mesh over the median of its surroundings; order-tracked by motor speed."""
    order = window.order("gear_mesh")
    fastest_hz = order * float(np.abs(window.speed).max()) / (2.0 * np.pi)
    if fastest_hz >= 0.5 * window.rate_hz:
        raise NotComputableError(
            f"teeth mesh at {fastest_hz:.4g} Hz, above half the rate {window.rate_hz:g} Hz"
        )
    bins = max(BINS_PER_REVOLUTION, int(np.ceil(4.0 * order)))
    return _over_surroundings(*order_spectrum(window.centred, window, bins), order)


def named_line(window: Window) -> str:
    """Name of the ball-pass line that is highest above its surroundings.

    The geometric mean of the first two multiples is used. ``unclassified`` if none reaches
    ``SMALLEST_LINE`` times its surroundings. A ball fault often shows the lines of the race it
    strikes, so the name is that of a line, not of the faulty part.
    """
    orders, amplitude = _envelope_orders(window)
    heights = {
        line: float(np.sqrt(np.prod([_height(orders, amplitude, order * k) for k in (1, 2)])))
        for line, order in window.orders.items()
    }
    if not heights:
        raise NotComputableError("no ball-pass orders are configured")
    line = max(heights, key=heights.__getitem__)
    return line if heights[line] >= SMALLEST_LINE else "unclassified"


@shared
def _envelope_orders(window: Window) -> tuple[Floats, Floats]:
    rows = envelope(window)
    return order_spectrum(rows - rows.mean(axis=1, keepdims=True), window)


def _height(orders: Floats, amplitude: Floats, order: float) -> float:
    return float(_over_surroundings(orders, amplitude, order).max())


def _over_surroundings(orders: Floats, amplitude: Floats, order: float) -> Floats:
    """Largest amplitude within the tolerance over the median of the surroundings."""
    on_line, around = line_and_surroundings(orders, order)
    surroundings = np.median(amplitude[:, around], axis=1)
    if not (surroundings > 0.0).all():
        raise NotComputableError("an axis is constant: its envelope is zero")
    return np.asarray(amplitude[:, on_line].max(axis=1) / surroundings)


def line_and_surroundings(orders: Floats, order: float) -> tuple[Flags, Flags]:
    """Which bins of a spectrum hold a line, and which are around it.

    Raises
    ------
    NotComputableError
        The order is outside the spectrum.
    """
    distance = np.abs(orders / order - 1.0)
    around = (distance <= SURROUNDINGS) & (distance > 2.0 * ORDER_TOLERANCE)
    if orders[-1] < order or not around.any():
        raise NotComputableError(f"order {order:g} is outside the spectrum of this window")
    return distance <= max(ORDER_TOLERANCE, 0.51 * orders[1] / order), around


@shared
def stretches(window: Window) -> list[tuple[int, int]]:
    """Stretches of one direction, above the lowest speed and at least two revolutions long."""
    direction = np.where(np.abs(window.speed) > SLOWEST_RAD_S, np.sign(window.speed), 0.0)
    edges = np.flatnonzero(np.diff(direction)) + 1
    bounds = [0, *edges.tolist(), window.count]
    angle = window.shaft_angle_rad
    least = FEWEST_REVOLUTIONS * 2.0 * np.pi
    found = [
        (start, stop)
        for start, stop in pairwise(bounds)
        if direction[start] and abs(angle[stop - 1] - angle[start]) >= least
    ]
    if not found:
        raise NotComputableError(
            f"the shaft turns less than {FEWEST_REVOLUTIONS:g} revolutions faster than "
            f"{SLOWEST_RAD_S:g} rad/s in one direction within the window"
        )
    return found


def by_angle(
    rows: Floats, window: Window, start: int, stop: int, per_revolution: int
) -> npt.NDArray[np.float64]:
    """Mean of each row in each bin of travelled angle, without its mean, shape (axes, bins)."""
    travelled = np.abs(window.shaft_angle_rad[start:stop] - window.shaft_angle_rad[start])
    bins = (travelled * (per_revolution / (2.0 * np.pi))).astype(np.intp)
    visits = np.maximum(np.bincount(bins), 1)
    means = np.stack([np.bincount(bins, row[start:stop]) / visits for row in rows])
    return np.asarray(means - means.mean(axis=1, keepdims=True))
