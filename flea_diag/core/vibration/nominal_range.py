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

"""Nominal range of a feature on a healthy actuator, as a function of the operating point.

Vibration grows with speed and load. The expected value is a polynomial in both; the range
around it contains all but a stated share of the nominal windows it was learned from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from flea_diag.errors import CalibrationError
from flea_diag.fields.values import Count, FieldLimits, Share, within

SPEED_UNIT_RAD_S = 100.0  # scale of a regressor: any
LOAD_UNIT_N = 100.0  # scale of a regressor: any
MOVING_RAD_S = 15.0
"""Root mean square speed from which on mechanical faults show."""
FAST_RAD_S = 55.0
"""RMS speed from which impacts are frequent enough to isolate a pit from a jam; at low speed the
few impacts of both are indistinguishable."""
RATE_TOLERANCE = 0.01
"""Largest relative error of the sampling rate."""
LEAST_WINDOWS = 20  # assumption: size of a sample
NEAR_FASTEST = 0.8
"""In slower motion, windows of at least this share of its fastest window are used."""


@dataclass(frozen=True)
class VibrationOperatingPoint:
    """Root mean square of speed and load over a window; NaN where not measured."""

    speed_rad_s: float = math.nan
    load_n: float = math.nan

    @property
    def moving(self) -> bool:
        """Whether the shaft turned enough to show a mechanical fault; not where it is unknown."""
        return self.speed_rad_s >= MOVING_RAD_S


HalfWidths = Annotated[float, FieldLimits(minimum=1.0, open=math.inf)]


@dataclass(frozen=True)
class NominalRange:
    """Range of one feature: centre(operating point) + [low, high], in ``logarithmic`` units.

    ``much``: distance below and above the middle, in half widths of the range, from which a value
    is much below or much above nominal; it separates faults that raise a feature slightly from
    those that raise it strongly. ``upper``: start of the upper part of the range; it separates
    faults that stay inside the range. ``speed_rad_s`` and ``load_n``: (lowest, highest) values
    learned from; a point outside is moved to the nearest end, not extrapolated.
    """

    coefficients: tuple[float, ...]
    low: float
    high: float
    logarithmic: bool = False
    count: Count = 0
    speed_rad_s: tuple[float, float] = (0.0, 0.0)
    load_n: tuple[float, float] = (0.0, 0.0)
    much: tuple[HalfWidths, HalfWidths] = (math.inf, math.inf)
    upper: Annotated[float, within(-1.0, 1.0)] = 1.0

    def at(self, point: VibrationOperatingPoint) -> tuple[float, float]:
        """Lowest and highest nominal value at an operating point; NaN where it is unknown."""
        centre = self.centre(point)
        low, high = centre + self.low, centre + self.high
        return (math.exp(low), math.exp(high)) if self.logarithmic else (low, high)

    def centre(self, point: VibrationOperatingPoint) -> float:
        """Expected value, or its logarithm, at an operating point; NaN where it is unknown."""
        speed = min(max(point.speed_rad_s, self.speed_rad_s[0]), self.speed_rad_s[1])
        load = min(max(point.load_n, self.load_n[0]), self.load_n[1])
        if self.depends_on_motion and math.isnan(point.speed_rad_s):
            return math.nan
        row = _row(speed, 0.0 if math.isnan(point.load_n) else load)
        return sum(a * b for a, b in zip(self.coefficients, row, strict=False))

    def symbol(self, value: float, point: VibrationOperatingPoint) -> str:
        """``--`` much below, ``-`` below, ``0`` inside, ``0^`` in the upper part, ``+``, ``++``.

        ``?`` where value or range is unknown.
        """
        deviation = self.deviation(value, point)
        if math.isnan(deviation):
            return "?"
        sign = "-" if deviation < 0.0 else "+"
        much = self.much[0] if deviation < 0.0 else self.much[1]
        if abs(deviation) <= 1.0:
            return "0" if deviation <= self.upper else "0^"
        return sign if abs(deviation) <= much else 2 * sign

    def deviation(self, value: float, point: VibrationOperatingPoint) -> float:
        """Value on the scale of the range: -1 at its lower end, +1 at its upper; NaN unknown."""
        low, high = self.at(point)
        if math.isnan(value) or math.isnan(low):
            return math.nan
        if self.logarithmic:
            if value <= 0.0:
                return -math.inf
            value, low, high = math.log(value), math.log(low), math.log(high)
        return (2.0 * value - low - high) / (high - low)

    @property
    def depends_on_motion(self) -> bool:
        """Whether the range depends on the speed."""
        return any(self.coefficients[1:])

    def as_mapping(self) -> dict[str, Any]:
        """Plain values for YAML."""
        return {
            "logarithmic": self.logarithmic,
            "coefficients": list(self.coefficients),
            "low": self.low,
            "high": self.high,
            "much": list(self.much),
            "upper": self.upper,
            "count": self.count,
            "speed_rad_s": list(self.speed_rad_s),
            "load_n": list(self.load_n),
        }

    def contradiction(self) -> str:
        """What is wrong with it, beyond each number; empty: nothing."""
        if not self.low < self.high:
            return f"low = {self.low!r} must be below high = {self.high!r}"
        return ""


def learn_nominal(
    values: npt.ArrayLike,
    false_alarm_rate: float,
    points: Sequence[VibrationOperatingPoint] = (),
    *,
    logarithmic: bool = False,
) -> NominalRange:
    """Range that a new nominal value leaves with at most ``false_alarm_rate``.

    The centre is fitted to the operating points by least squares; the ends are order
    statistics of what is left, so the rate holds for any distribution: with n values, a new
    one falls below the k-th smallest with probability k/(n + 1). Where n is too small for the
    rate, the end lies beyond the extreme by the exponential tail of the outermost tenth.

    Parameters
    ----------
    values : (n,) of one feature over nominal windows; NaN are left out
    points : (n,) operating points, or none for a range that is the same everywhere

    Raises
    ------
    CalibrationError
        With fewer than 20 finite values, values that are all equal, or a logarithmic feature
        that is not positive.
    """
    found = np.asarray(values, dtype=np.float64)
    kept = np.isfinite(found)
    if points:
        kept &= np.array([math.isfinite(point.speed_rad_s) for point in points])
    found = found[kept]
    if len(found) < LEAST_WINDOWS:
        raise CalibrationError(
            f"{len(found)} nominal values cannot make a range, give at least {LEAST_WINDOWS}"
        )
    if not np.ptp(found) > 0.0:
        raise CalibrationError(f"all nominal values are {found[0]!r}: a range needs some spread")
    if logarithmic and not (found > 0.0).all():
        raise CalibrationError(f"nominal value {found.min()!r} has no logarithm")
    scaled = np.log(found) if logarithmic else found
    known = [point for point, keep in zip(points, kept, strict=True) if keep] if points else []
    coefficients, rest = _fit(scaled, known)
    side = false_alarm_rate / 2.0
    return NominalRange(
        coefficients,
        -tail_end(-rest, side),
        tail_end(rest, side),
        logarithmic,
        len(found),
        _span([point.speed_rad_s for point in known]),
        _span([point.load_n for point in known]),
    )


def tail_end(values: npt.NDArray[np.float64], rate: float) -> float:
    """Upper end that a new value passes with probability ``rate`` (Weibull plotting position).

    values : (n,), two at least
    """
    ordered = np.sort(values)
    place = (1.0 - rate) * (len(ordered) + 1) - 1.0
    if place <= len(ordered) - 1:
        return float(np.interp(place, np.arange(len(ordered)), ordered))
    outer = max(2, len(ordered) // 10)
    spacing = float(np.mean(ordered[-outer:] - ordered[-outer]))
    # The outermost tenth is assumed exponential: its mean excess is the scale of the tail.
    return float(ordered[-1] + spacing * math.log((1.0 / (len(ordered) + 1)) / rate))


def _row(speed_rad_s: float, load_n: float) -> tuple[float, ...]:
    """Regressors at one operating point."""
    speed, load = speed_rad_s / SPEED_UNIT_RAD_S, load_n / LOAD_UNIT_N
    return (1.0, math.log(0.1 + speed), speed, math.log(0.5 + load))


def _fit(
    values: npt.NDArray[np.float64], points: Sequence[VibrationOperatingPoint]
) -> tuple[tuple[float, ...], npt.NDArray[np.float64]]:
    """Coefficients and residuals of the fit; only the median if there are no points."""
    if not points:
        centre = float(np.median(values))
        return (centre,), values - centre
    loads = [0.0 if math.isnan(point.load_n) else point.load_n for point in points]
    design = np.array(
        [_row(point.speed_rad_s, load) for point, load in zip(points, loads, strict=True)]
    )
    # Ridge: a coefficient that the motion hardly excites stays near zero instead of diverging.
    penalty = np.diag([0.0, 1.0, 1.0, 1.0]) * 1e-3 * len(design)
    solution = np.linalg.solve(design.T @ design + penalty, design.T @ values)
    return tuple(float(c) for c in solution), values - design @ solution


def _span(values: Sequence[float]) -> tuple[float, float]:
    finite = [value for value in values if math.isfinite(value)]
    return (min(finite), max(finite)) if finite else (0.0, 0.0)


@dataclass(frozen=True)
class NominalRanges:
    """Nominal ranges of all features, and of the monitor's indicators of each axis and block.

    ``levels`` and ``resting_levels``: the standard deviation, in motion and at rest; ``kurtosis``:
    in motion. The ranges of features hold for windows of ``window_s`` sampled at ``rate_hz``;
    ``orders`` are the ball-pass orders used by the order-tracked features.
    """

    rate_hz: Annotated[float, within(0.0, 1e6)] = 0.0
    window_s: Annotated[float, within(0.01, 60.0)] = 1.0
    false_alarm_rate: Share = math.nan
    ranges: Mapping[str, NominalRange] = field(default_factory=dict)
    levels: Mapping[str, NominalRange] = field(default_factory=dict)
    resting_levels: Mapping[str, NominalRange] = field(default_factory=dict)
    kurtosis: Mapping[str, NominalRange] = field(default_factory=dict)
    orders: Mapping[str, Annotated[float, within(0.01, 1000.0)]] = field(default_factory=dict)

    def holds_at(self, rate_hz: float, tolerance: float = RATE_TOLERANCE) -> bool:
        """Whether vibration sampled at this rate may be held against these ranges."""
        return not self.rate_hz or abs(rate_hz / self.rate_hz - 1.0) <= tolerance

    def symbol(self, feature: str, value: float, point: VibrationOperatingPoint) -> str:
        """``-``, ``0`` or ``+`` against the nominal range, ``?`` where there is none."""
        found = self.ranges.get(feature)
        return found.symbol(value, point) if found else "?"

    def at(self, feature: str, point: VibrationOperatingPoint) -> tuple[float, float]:
        """Nominal range at an operating point, NaN where there is none."""
        found = self.ranges.get(feature)
        return found.at(point) if found else (math.nan, math.nan)
