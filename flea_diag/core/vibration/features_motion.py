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

"""Condition indicators that relate vibration, current or temperature to the motion.

Those of the scans are the indirect features of Narasimhan et al. 2010, section 3.2: regressions
of the motor current and the temperatures over the scans of the window.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flea_diag.core.vibration.window import Floats, NotComputableError, Window, shared

REST_RAD_S = 10.0  # the FLEA's, assumption
MOVING_RAD_S = 30.0  # the FLEA's, assumption
SHORTEST_S = 0.01  # assumption: size of a sample
REVERSAL_RAD_S = 2.0  # the FLEA's, assumption
REVERSAL_N = 5.0  # the FLEA's, assumption
REVERSAL_S = 0.03
"""Half width of the stretch around a reversal in which backlash strikes."""

LEVEL_S = 0.01  # one scan at 100 Hz, the finest in which the slow channels can be compared
WORST_CONDITION = 50.0
"""Largest condition number of the scaled regression; beyond it the coefficients are noise."""


def reverses(speed_rad_s: npt.ArrayLike, load_n: npt.ArrayLike) -> bool:
    """Whether motion or load crosses its band from one side to the other.

    Backlash, if any, is taken up then: in a window without a reversal a worn nut does not show.
    """
    turning = ((speed_rad_s, REVERSAL_RAD_S), (load_n, REVERSAL_N))
    rows = [(np.asarray(values, float), band) for values, band in turning]
    return any((row > band).any() and (row < -band).any() for row, band in rows)


def rest_moving_ratio(window: Window) -> Floats:
    """Ratio of the standard deviation at rest to that in motion.

    Machine vibration stops with the motion; the noise of a failing accelerometer continues.
    """
    speed = np.abs(window.speed)
    rest, moving = speed < REST_RAD_S, speed > MOVING_RAD_S
    for name, part in (("below 10", rest), ("above 30", moving)):
        if part.sum() < SHORTEST_S * window.rate_hz:
            raise NotComputableError(f"the window has less than {SHORTEST_S:g} s {name} rad/s")
    return _level(window, rest) / _positive(_level(window, moving))


def rest_std(window: Window) -> Floats:
    """Level while the shaft is slower than 10 rad/s: standard deviation, m/s^2."""
    rest = np.abs(window.speed) < REST_RAD_S
    if rest.sum() < SHORTEST_S * window.rate_hz:
        raise NotComputableError(f"the window has less than {SHORTEST_S:g} s below 10 rad/s")
    return _level(window, rest)


def reversal_ratio(window: Window) -> Floats:
    """Peak within 30 ms of a reversal over the standard deviation elsewhere, a ratio.

    The backlash of a worn nut is taken up with an impact when the screw reverses or the load
    changes sign.
    """
    turns: list[Floats] = [_turns(window.speed, REVERSAL_RAD_S) / window.rate_hz]
    load = window.slow.get("load_force")
    if load is not None and np.isfinite(load).all():
        turns.append(window.slow_time_s[_turns(load, REVERSAL_N)])
    around = np.zeros(window.count, dtype=bool)
    for turn_s in np.concatenate(turns):
        first = max(round((turn_s - REVERSAL_S) * window.rate_hz), 0)
        around[first : round((turn_s + REVERSAL_S) * window.rate_hz) + 1] = True
    if not around.any():
        raise NotComputableError("neither motion nor load reverses within the window")
    if around.all():
        raise NotComputableError("the whole window lies within 30 ms of a reversal")
    peaks = np.sqrt((_squares(window) * around).max(axis=1))
    return np.asarray(peaks / _positive(_level(window, ~around)))


def speed_correlation(window: Window) -> Floats:
    """Correlation of the level of vibration, over 10 ms, with |motor speed|, -1 to 1."""
    points = round(LEVEL_S * window.rate_hz)
    blocks = window.count // points
    speed = np.abs(window.speed[: blocks * points]).reshape(blocks, points).mean(axis=1)
    return _correlation(_levels(window), speed)


def current_correlation(window: Window) -> Floats:
    """Correlation of the level of vibration, over 10 ms, with |motor current|, -1 to 1."""
    levels = _levels(window)
    middle = (np.arange(levels.shape[1]) + 0.5) * LEVEL_S
    current = np.interp(middle, window.slow_time_s, np.abs(window.channel("motor_current")))
    return _correlation(levels, current)


def level_correlation(window: Window) -> float:
    """Correlation of the levels, over 10 ms, of the first two accelerometers, -1 to 1."""
    names = window.accelerometers
    if len(names) < 2:
        raise NotComputableError("needs two accelerometers, the stream has one")
    first, second = (_levels(window.of(name)).mean(axis=0) for name in names[:2])
    return float(_correlation(first[np.newaxis], second)[0])


def current_coulomb(window: Window) -> float:
    """Motor current that goes with the direction of motion, A: i = a + c sgn(w) + b w + ..."""
    return _friction(window)[0]


def current_viscous(window: Window) -> float:
    """Motor current that goes with the speed, A s/rad: i = a + c sgn(w) + b w + ..."""
    return _friction(window)[1]


def voltage_speed(window: Window) -> float:
    """Motor voltage that goes with the speed, V s/rad: v = a + r i + k w, the back-EMF constant."""
    return _circuit(window)[1]


def voltage_current(window: Window) -> float:
    """Motor voltage that goes with the current, ohm: v = a + r i + k w, the winding resistance."""
    return _circuit(window)[0]


def motor_heating(window: Window) -> float:
    """Slope of the motor temperature over the window, K/s."""
    return _slope(window, "motor_temperature")


def nut_heating(window: Window) -> float:
    """Slope of the nut temperature over the window, K/s."""
    return _slope(window, "nut_temperature")


@shared
def _friction(window: Window) -> tuple[float, float]:
    """Coefficients of sgn(w) and w in the current, load and acceleration accounted for."""
    speed = window.channel("motor_speed")
    moving = np.abs(speed) > REST_RAD_S
    columns = [np.sign(speed), speed, np.ones(len(speed)), np.gradient(speed, window.slow_time_s)]
    load = window.slow.get("load_force")
    if load is not None and np.isfinite(load).all() and np.unique(load[moving]).size > 1:
        columns.append(load)
    design = np.stack(columns, axis=1)[moving]
    if len(design) <= len(columns):
        raise NotComputableError(
            f"only {len(design)} scans in the window are faster than {REST_RAD_S:g} rad/s"
        )
    current = window.channel("motor_current")[moving]
    found = _coefficients(design, current, "sgn(w), w and load")
    return found[0], found[1]


@shared
def _circuit(window: Window) -> tuple[float, float]:
    """Coefficients of the current and of the speed in the motor voltage.

    Bypassed turns lower both: the motor needs less voltage for the same speed and current.
    """
    current, speed = window.channel("motor_current"), window.channel("motor_speed")
    if np.sqrt(np.mean(np.square(speed))) < REST_RAD_S:
        raise NotComputableError(f"the shaft turns slower than {REST_RAD_S:g} rad/s")
    design = np.stack([current, speed, np.ones(len(speed))], axis=1)
    found = _coefficients(design, window.channel("motor_voltage"), "current and speed")
    return found[0], found[1]


def _coefficients(design: Floats, values: Floats, what: str) -> list[float]:
    """Least squares; refused if the motion does not separate the columns.

    design : (scans, columns), values : (scans,)
    """
    scale = np.sqrt(np.mean(np.square(design), axis=0))
    scale[scale == 0.0] = 1.0
    singular = np.linalg.svd(design / scale, compute_uv=False)
    if singular[0] > WORST_CONDITION * singular[-1]:
        raise NotComputableError(f"the motion in the window does not separate {what}")
    solution = np.linalg.lstsq(design / scale, values)[0] / scale
    return [float(value) for value in solution]


def _turns(values: Floats, band: float) -> npt.NDArray[np.intp]:
    """Indices at which values have crossed a band from one side to the other."""
    beyond = np.flatnonzero(np.abs(values) > band)
    turned = np.flatnonzero(np.diff(np.sign(values[beyond])))
    return np.asarray(beyond[turned + 1])


def _slope(window: Window, channel: str) -> float:
    """Least-squares slope of one slow channel over time."""
    return float(np.polyfit(window.slow_time_s, window.channel(channel), 1)[0])


def _level(window: Window, part: npt.NDArray[np.bool_]) -> Floats:
    """Level of each axis over a part of the window: standard deviation, shape (axes,)."""
    weight = part.astype(np.float32) / np.float32(part.sum())
    variance = _squares(window) @ weight - np.square(window.centred @ weight)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


@shared
def _squares(window: Window) -> Floats:
    """Squares of the centred rows, shape (axes, n)."""
    return np.square(window.centred)


@shared
def _levels(window: Window) -> Floats:
    """Levels of blocks of 10 ms: standard deviations, shape (axes, blocks)."""
    points = round(LEVEL_S * window.rate_hz)
    blocks = window.count // points
    if blocks < 8:
        raise NotComputableError(
            f"window of {window.duration_s:g} s is shorter than 8 blocks of 10 ms"
        )
    rows = window.centred[:, : blocks * points].reshape(len(window.axes), blocks, points)
    return np.asarray(np.sqrt(np.einsum("abn,abn->ab", rows, rows) / points))


def _correlation(rows: Floats, reference: Floats) -> Floats:
    """Pearson's correlation of each row with a reference, shape (rows,)."""
    rows = rows - rows.mean(axis=1, keepdims=True)
    reference = reference - reference.mean()
    norm = np.sqrt(np.square(rows).sum(axis=1) * np.square(reference).sum())
    return np.asarray(rows @ reference / _positive(norm))


def _positive(values: Floats) -> Floats:
    """Refuse values that are not above zero."""
    if not (values > 0.0).all():
        raise NotComputableError("a signal is constant: ratio undefined")
    return values
