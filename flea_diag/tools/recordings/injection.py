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

"""Sensor faults injected by software into recordings after the DAQ, as in the paper.

The recording of a healthy actuator is kept; one channel is falsified from the onset on. ``ROWS``
holds the sizes drawn for each channel and mode, and the ladder of severities that shows its
detection limit. All draws are seeded: row, run, seed and case determine the readings bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.motion import MOVING_M_S, speed
from flea_diag.wire.records import ChannelTable, Record, Scan, Truth

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

CLEAR_S = 8.0
"""Least distance of an onset from either end of a recording."""
GAP_S = 0.05
"""Length of a drop-out, during which the reading is zero."""


@dataclass(frozen=True)
class ChannelFault:
    """One sensor fault of one channel.

    ``size`` is in the unit of the channel; in units per second for a drift, a factor for a
    scaling, a standard deviation for noise, the constant reading for dead, drop-outs per second
    for a dropout; unused for stuck (the last value is held). ``seed`` is for noise and drop-outs.
    """

    channel: str
    mode: str
    size: float
    onset_s: float
    seed: int = 0

    @property
    def fault(self) -> str:
        """Fault id of the catalogue; a stuck sensor counts as dead."""
        return f"{self.channel}_{'dead' if self.mode == 'stuck' else self.mode}"


def _bias(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    return true + fault.size


def _drift(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    return true + fault.size * age_s


def _scaling(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    return true * fault.size


def _dead(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    return np.full_like(true, fault.size)


def _stuck(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    measured = true[np.isfinite(true)]
    return np.full_like(true, measured[0] if len(measured) else math.nan)


def _noise(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    return true + fault.size * np.random.default_rng(fault.seed).standard_normal(len(true))


def _dropout(true: Array, age_s: Array, fault: ChannelFault) -> Array:
    slots = ((age_s + 1e-9) / GAP_S).astype(np.int64)
    count = int(slots.max(initial=0)) + 1
    gone = np.random.default_rng(fault.seed).random(count) < GAP_S * fault.size
    return np.where(gone[slots], 0.0, true)


MODES: dict[str, Callable[[Array, Array, ChannelFault], Array]] = {
    "bias": _bias,
    "drift": _drift,
    "scaling": _scaling,
    "dead": _dead,
    "stuck": _stuck,
    "noise": _noise,
    "dropout": _dropout,
}
"""Mode -> reading from the true readings since the onset and the time since then (s)."""


def faulted(
    values: Array,
    times_s: Array,
    injection: ChannelFault,
    low: float = -math.inf,
    high: float = math.inf,
) -> Array:
    """Readings of a channel with the fault, shape (n,) as ``values`` and ``times_s``.

    ``times_s`` counts from the first scan. Readings are clipped to ``low`` and ``high``, as by
    the DAQ; unmeasured readings (NaN) stay NaN.
    """
    if injection.mode not in MODES:
        raise ConfigurationError(
            f"mode {shown(injection.mode)} is unknown: choose one of {', '.join(MODES)}"
        )
    reading = values.copy()
    since = times_s >= injection.onset_s
    age_s = times_s[since] - injection.onset_s
    wrong = np.clip(MODES[injection.mode](values[since], age_s, injection), low, high)
    reading[since] = np.where(np.isnan(values[since]), np.nan, wrong)
    return reading


def inject(
    scans: Sequence[Scan],
    injection: ChannelFault,
    low: float = -math.inf,
    high: float = math.inf,
) -> tuple[Scan, ...]:
    """Scans with the fault in one channel; ``low`` and ``high`` are its range.

    Raises
    ------
    ConfigurationError
        The mode is unknown, or no scan contains the channel.
    """
    if not any(injection.channel in scan.channels for scan in scans):
        raise ConfigurationError(f"no scan contains the channel {shown(injection.channel)}")
    first = scans[0].stamp_ns
    holding = [k for k, scan in enumerate(scans) if injection.channel in scan.channels]
    at = [scans[k].channels.index(injection.channel) for k in holding]
    values = np.array([scans[k].values[column] for k, column in zip(holding, at, strict=True)])
    times_s = np.array([(scans[k].stamp_ns - first) / 1e9 for k in holding])
    out = list(scans)
    reading = faulted(values, times_s, injection, low, high)
    for k, column, value in zip(holding, at, reading.tolist(), strict=True):
        row = scans[k].values
        out[k] = replace(scans[k], values=(*row[:column], value, *row[column + 1 :]))
    return tuple(out)


def injected(
    table: ChannelTable, scans: Sequence[Scan], fault: ChannelFault, *details: tuple[str, str]
) -> tuple[Record, ...]:
    """A recording with a fault in one channel, clipped to its range, and the truth of it."""
    info = table.info(fault.channel)
    low, high = (info.minimum, info.maximum) if info else (-math.inf, math.inf)
    start_ns = scans[0].stamp_ns
    told = (("size", repr(fault.size)), *details)
    truth = Truth(start_ns, fault.fault, start_ns + round(fault.onset_s * 1e9), told)
    return (table, truth, *inject(scans, fault, low, high))


@dataclass(frozen=True)
class InjectionSizes:
    """Sizes of one channel and mode, drawn between ``low`` and ``high`` with random sign.

    ``ladder`` holds severities from small to large, some of them below ``low``.
    """

    channel: str
    mode: str
    low: float
    high: float
    ladder: tuple[float, ...]

    def size(self, severity: float, upward: bool) -> float:
        """Signed size; for a scaling ``severity`` is the difference from 1."""
        if self.mode == "scaling":
            return 1.0 + severity if upward else 1.0 - severity
        if self.mode in ("bias", "drift"):
            return severity if upward else -severity
        return severity


ROWS: tuple[InjectionSizes, ...] = (
    InjectionSizes("motor_current", "bias", 0.3, 1.0, (0.1, 0.2, 0.3, 0.4, 0.6, 1.0)),
    InjectionSizes("motor_current", "drift", 0.05, 0.2, (0.01, 0.02, 0.05, 0.1, 0.2)),
    InjectionSizes("motor_current", "scaling", 0.2, 0.4, (0.05, 0.1, 0.2, 0.3, 0.4)),
    InjectionSizes("motor_current", "dead", 0.0, 0.0, (0.0,)),
    InjectionSizes("motor_current", "stuck", 0.0, 0.0, (0.0,)),
    InjectionSizes("motor_current", "noise", 0.6, 2.0, (0.2, 0.4, 0.6, 1.0, 2.0)),
    InjectionSizes("motor_current", "dropout", 0.5, 3.0, (0.1, 0.2, 0.5, 1.0, 3.0)),
    InjectionSizes("motor_temperature", "bias", 4.0, 8.0, (1.0, 2.0, 4.0, 6.0, 8.0)),
    InjectionSizes("motor_temperature", "drift", 0.3, 0.8, (0.05, 0.1, 0.2, 0.3, 0.8)),
    InjectionSizes("motor_temperature", "scaling", 0.25, 0.4, (0.05, 0.1, 0.15, 0.25, 0.4)),
    InjectionSizes("motor_temperature", "dead", 0.0, 0.0, (0.0,)),
    InjectionSizes("motor_temperature", "stuck", 0.0, 0.0, (0.0,)),
    InjectionSizes("motor_temperature", "noise", 2.0, 6.0, (0.5, 1.0, 2.0, 4.0, 6.0)),
    InjectionSizes("motor_temperature", "dropout", 0.5, 3.0, (0.1, 0.2, 0.5, 1.0, 3.0)),
    InjectionSizes(
        "actuator_position", "bias", 0.001, 0.006, (0.0003, 0.0005, 0.001, 0.002, 0.006)
    ),
    InjectionSizes("actuator_position", "drift", 0.0003, 0.002, (0.0003, 0.0007, 0.001, 0.002)),
    InjectionSizes("actuator_position", "scaling", 0.1, 0.15, (0.02, 0.05, 0.1, 0.15)),
    InjectionSizes("actuator_position", "dead", 0.0, 0.0, (0.0,)),
    InjectionSizes("actuator_position", "stuck", 0.0, 0.0, (0.0,)),
    InjectionSizes(
        "actuator_position", "noise", 0.0005, 0.002, (0.0001, 0.0002, 0.0005, 0.001, 0.002)
    ),
    InjectionSizes("actuator_position", "dropout", 0.5, 3.0, (0.1, 0.2, 0.5, 1.0, 3.0)),
)
"""Fixed before any evaluation; sizes below ``low`` only serve to find the detection limit."""


def row_of(channel: str, mode: str) -> InjectionSizes:
    """Row of a channel and mode.

    Raises
    ------
    ConfigurationError
        There is none; names the known ones.
    """
    for row in ROWS:
        if (row.channel, row.mode) == (channel, mode):
            return row
    known = ", ".join(f"{row.channel} {row.mode}" for row in ROWS)
    raise ConfigurationError(f"no sizes for {channel} {mode}: choose of {known}")


def onsets(times_s: Array, position_m: Array) -> Array:
    """Possible onset times: in motion, and at least ``CLEAR_S`` from both ends."""
    inside: Bools = (times_s >= times_s[0] + CLEAR_S) & (times_s <= times_s[-1] - CLEAR_S)
    return np.asarray(times_s[inside & (np.abs(speed(times_s, position_m)) > MOVING_M_S)])


def draw(
    row: InjectionSizes, onsets_s: Array, seed: int, case: int, severity: float | None = None
) -> ChannelFault:
    """One case of a row: size (unless ``severity`` is given), sign and onset drawn by ``seed``.

    Raises
    ------
    ConfigurationError
        No onset is possible: the recording is too short or has too little motion.
    """
    if not len(onsets_s):
        raise ConfigurationError(
            f"{row.channel} {row.mode}: no onset is possible: the recording needs motion faster "
            f"than {MOVING_M_S} m/s at least {CLEAR_S:g} s from both ends"
        )
    words: Iterable[int] = (seed, ROWS.index(row), case)
    generator = np.random.default_rng(list(words))
    share, upward = float(generator.random()), bool(generator.integers(2))
    onset_s = float(onsets_s[generator.integers(len(onsets_s))])
    strength = row.low + share * (row.high - row.low) if severity is None else severity
    noise_seed = int(generator.integers(2**31))
    return ChannelFault(row.channel, row.mode, row.size(strength, upward), onset_s, noise_seed)
