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

"""How long one channel comes after another, from the relations that both are in.

Each relation of the balance of power is fitted with one channel shifted by a whole number of scans;
the shift that leaves the least is the lag. Motion that does not change tells nothing: what is
left is then the same for all shifts, and no lag is stated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import (
    CURRENT,
    LOAD,
    POSITION,
    SMOOTHED_S,
    SPEED,
    is_supply_current,
    rate_of,
    smoothed,
)
from flea_diag.core.calibration.sign_check import roles_of

Array = npt.NDArray[np.float64]

LONGEST_S = 0.4
"""Largest lag that is looked for."""
ROWS_A_SPREAD = 8
"""Rows that are used of each length over which readings are averaged."""
FEWEST_ROWS = 100
"""Rows without which nothing is fitted."""
SIGMAS = 5.0
"""Standard errors from which on a lag is one."""
LEAST_S = 0.015
"""A shorter one is that of a filter of a sensor."""
SHARP_S = 0.02
"""Standard error above which the motion tells too little."""


@dataclass(frozen=True)
class ChannelLag:
    """``channel`` comes ``lag_s`` after ``after``; below 0 it comes before."""

    channel: str
    after: str
    lag_s: float
    error_s: float

    @property
    def is_late(self) -> bool:
        """Whether it is beyond its error, and beyond what filters of sensors make."""
        return abs(self.lag_s) > max(LEAST_S, SIGMAS * self.error_s)

    @property
    def words(self) -> str:
        """The lag in words, the later channel first."""
        pair = (self.channel, self.after) if self.lag_s >= 0.0 else (self.after, self.channel)
        lag_ms, error_ms = 1e3 * abs(self.lag_s), 1e3 * self.error_s
        return f"{pair[0]} comes {lag_ms:.0f} ms after {pair[1]} (standard error {error_ms:.0f} ms)"


class _Relation(NamedTuple):
    """What is fitted by what; the role that is shifted, and the one that it is held against."""

    target: str
    columns: tuple[str, ...]
    shifted: str
    after: str


RATE, GAIN, WAY = "rate", "gain", "way"
"""Rate of the position, its rate, and the direction of motion."""
RELATIONS = (
    _Relation(SPEED, (RATE,), POSITION, SPEED),
    _Relation(CURRENT, (WAY, RATE, GAIN, LOAD), LOAD, CURRENT),
)


def channel_lags(units: Mapping[str, str], values: Array, period_s: float) -> list[ChannelLag]:
    """Lags between the channels of a recording, where its motion shows them.

    Parameters
    ----------
    units
        SI unit of each channel, in the order of the columns.
    values
        Readings in SI, shape (scans, channels); a row of NaN parts two recordings.
    period_s
        Time between two scans.
    """
    names, roles = list(units), roles_of(units)
    signals = {role: values[:, names.index(name)] for role, name in roles.items()}
    if POSITION not in signals:
        return []
    if CURRENT in signals and is_supply_current(signals[CURRENT], signals[POSITION], period_s):
        del signals[CURRENT]
    # Twice: of an acceleration with noise in it less is taken, and a lag makes up for the rest.
    mean = {r: smoothed(smoothed(each, period_s), period_s) for r, each in signals.items()}
    return list(_lags(mean, roles, period_s))


def _lags(
    mean: Mapping[str, Array], roles: Mapping[str, str], period_s: float
) -> Iterator[ChannelLag]:
    most = round(LONGEST_S / period_s)
    for relation in RELATIONS:
        if not {relation.target, relation.shifted, relation.after} <= mean.keys():
            continue
        shifts = range(-most, most + 1)
        found = _least([_left(relation, mean, shift, period_s) for shift in shifts])
        if found is not None and found[1] * period_s <= SHARP_S:
            lag_s, error_s = (float(scans) * period_s for scans in found)
            lag_s -= most * period_s
            yield ChannelLag(roles[relation.shifted], roles[relation.after], lag_s, error_s)


def _left(relation: _Relation, mean: Mapping[str, Array], shift: int, period_s: float) -> float:
    """Log-likelihood of the residuals with one signal earlier by ``shift`` scans, sign turned."""
    moved = {**mean, relation.shifted: _earlier(mean[relation.shifted], shift)}
    rate = rate_of(moved[POSITION], period_s)
    moved |= {RATE: rate, GAIN: rate_of(rate, period_s), WAY: smoothed(np.sign(rate), period_s)}
    columns = [moved[name] for name in relation.columns if name in moved]
    spread = max(1, round(2.0 * SMOOTHED_S / period_s))
    rows = slice(None, None, max(1, spread // ROWS_A_SPREAD))
    target = moved[relation.target][rows]
    table = np.column_stack([*(column[rows] for column in columns), np.ones(len(target))])
    use = np.isfinite(table).all(axis=1) & np.isfinite(target)
    count = int(use.sum())
    if count < FEWEST_ROWS:
        return np.nan
    _, squares, rank, _ = np.linalg.lstsq(table[use], target[use], rcond=None)
    if rank < table.shape[1] or not len(squares):
        return np.nan
    independent = count * (rows.step or 1) / spread
    return 0.5 * independent * float(np.log(squares[0] / count + 1e-300))


def _earlier(values: Array, shift: int) -> Array:
    """Readings as they would be ``shift`` scans earlier; NaN where none are known."""
    found = np.full(len(values), np.nan)
    if shift >= 0:
        found[: len(values) - shift] = values[shift:]
    else:
        found[-shift:] = values[:shift]
    return found


def _least(left: Sequence[float]) -> tuple[float, float] | None:
    """Place of the minimum, between its neighbours, and its standard error.

    None where it is at an end, or no deeper than noise makes it.
    """
    if not np.isfinite(left).all() or max(left) - min(left) < 0.5 * SIGMAS**2:
        return None
    at = int(np.argmin(left))
    if not 0 < at < len(left) - 1:
        return None
    before, least, after = (float(left[k]) for k in (at - 1, at, at + 1))
    curvature = before - 2.0 * least + after
    if curvature <= 0.0:
        return None
    return at + 0.5 * (before - after) / curvature, 1.0 / np.sqrt(curvature)
