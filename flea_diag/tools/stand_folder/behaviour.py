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

"""What series are whose names do not say: by which of them follows which.

A temperature is positive and slow. A speed is the rate of a position. Of the rest, those are
voltage, current and load that fit the equations of a motor best. A command has the least noise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import rate_of, smoothed
from flea_diag.tools.series.series_sum import SeriesSum
from flea_diag.tools.series.series_words import (
    COMMANDED,
    CURRENT,
    EFFORT,
    ERROR,
    FORCE,
    POSITION,
    SPEED,
    TEMPERATURE,
    TORQUE,
    VOLTAGE,
)

Array = npt.NDArray[np.float64]

MOST_ROWS = 3000
MOST_UNKNOWN = 12
"""Series without a telling name, of more of which nothing is told but temperatures."""
FEWEST_ROWS = 200  # assumption: size of a sample
COVERED = 0.8
"""Share of the recording that a series must cover to be told by what it follows."""
WHITE = 0.5
"""Share of noise, without memory, in the variance from which on a series does not move."""
SLOW_SHARE, LEAST_TEMPERATURE = 0.02, 5.0
"""Change of a temperature within a second, as a share of its reading; and its lowest reading."""
RATE_SHARE, LIKE, LIKE_COMMAND = 0.995, 0.995, 0.95
"""Shares of variance from which on one is the rate, a second reading or the command of another."""
SAME_SHARE = 0.97
"""Share of a voltage that no current explains, at any load."""
SECOND_VOLTAGE = 0.85
"""Share of a load that no voltage explains."""
LEAST_DECADES = 1.0
"""What the equations of a motor must explain at least."""
LESS_NOISE = 0.3
"""Scatter of a command, as a share of that of the reading that follows it."""


def named_by_behaviour(sources: Sequence[SeriesSum], period_s: float) -> tuple[SeriesSum, ...]:
    """The sources, with a quantity for those whose names say none."""
    found = _Behaviour(sources, period_s)
    if any(found.is_unknown(k) for k in range(len(sources))):
        found.temperatures()
        few = len(found.unknown()) <= MOST_UNKNOWN and len(sources[0].values) >= FEWEST_ROWS
        if few and any(moves(each.values) for each in sources):
            found.speeds()
            found.motor()
            found.others()
    return tuple(found.sources)


class _Behaviour:
    """Sources by number, with their smoothed readings and rates."""

    def __init__(self, sources: Sequence[SeriesSum], period_s: float) -> None:
        self.sources = list(sources)
        self._period_s = period_s
        mean = [smoothed(each.values, period_s) for each in sources]
        step = max(1, len(mean[0]) // MOST_ROWS)
        rate = [rate_of(each, period_s) for each in mean]
        self._gain = [rate_of(each, period_s)[::step] for each in rate]
        self._mean, self._rate = [m[::step] for m in mean], [r[::step] for r in rate]

    def is_unknown(self, number: int) -> bool:
        """Whether nothing is known of a source yet."""
        words = self.sources[number].words
        covers = float(np.isfinite(self.sources[number].values).mean()) >= COVERED
        return not words.quantity and ERROR not in words.qualifiers and covers

    def _are(self, quantity: str) -> list[int]:
        """Sources of a quantity that are no commands."""
        return [
            k
            for k, each in enumerate(self.sources)
            if each.words.quantity == quantity and not each.words.qualifiers & {COMMANDED, ERROR}
        ]

    def unknown(self) -> list[int]:
        """Sources of which nothing is known yet."""
        return [k for k in range(len(self.sources)) if self.is_unknown(k)]

    def _take(self, number: int, quantity: str, because: str, *qualifiers: str) -> None:
        each = self.sources[number]
        words = replace(
            each.words,
            quantity=quantity,
            qualifiers=each.words.qualifiers | frozenset(qualifiers),
        )
        self.sources[number] = replace(each, words=words, because=because)

    def temperatures(self) -> None:
        """Positive and slow; the least noisy is that of the air, the warmest that of the motor."""
        slow = [k for k in self.unknown() if self._is_slow(self.sources[k].values)]
        owners = ["motor", "nut"]
        if len(slow) > 1:
            air = min(slow, key=lambda k: _noise(self.sources[k].values, 1.0))
            self._take(air, TEMPERATURE, "it is positive, slow and the least noisy", "ambient")
            slow.remove(air)
        slow.sort(key=lambda k: -float(np.nanquantile(self.sources[k].values, 0.9)))
        for number, owner in zip(slow, owners, strict=False):
            self._take(number, TEMPERATURE, "it is positive and slow", owner)

    def _is_slow(self, values: Array) -> bool:
        length = max(2, round(1.0 / self._period_s))
        rows = values[: len(values) // length * length].reshape(-1, length)
        rows = rows[np.isfinite(rows).any(axis=1)]
        seconds = np.nanmean(rows, axis=1) if len(rows) else rows
        if len(seconds) < 3 or float(np.nanmin(seconds)) < LEAST_TEMPERATURE:
            return False
        return float(np.nanmax(np.abs(np.diff(seconds)))) < SLOW_SHARE * float(np.nanmean(seconds))

    def speeds(self) -> None:
        """The position and the speed that is its rate most exactly."""
        unknown = self.unknown()
        places, speeds = [*unknown, *self._are(POSITION)], [*unknown, *self._are(SPEED)]
        shares = {
            (place, speed): explained(self._mean[speed], [self._rate[place]])
            for place, speed in itertools.product(places, speeds)
            if place != speed and (self.is_unknown(place) or self.is_unknown(speed))
        }
        place, speed = max(shares, key=lambda pair: shares[pair], default=(0, 0))
        if shares.get((place, speed), 0.0) > RATE_SHARE:
            if self.is_unknown(speed):
                self._take(speed, SPEED, f"it is the rate of {self.sources[place].name}")
            if self.is_unknown(place):
                self._take(place, POSITION, f"{self.sources[speed].name} is its rate")

    def motor(self) -> None:
        """Position, voltage and current that the equations of a motor fit best."""
        free = [k for k in self.unknown() if not self._is_command(k)]
        places = self._are(POSITION) or free
        # A torque or an effort serves where no current is named.
        stand_in = [*self._are(EFFORT), *self._are(TORQUE)]
        currents = self._are(CURRENT) or stand_in or free
        voltages: list[int | None] = [*(self._are(VOLTAGE) or free), None]
        loads: list[int | None] = [*(self._are(FORCE) or free), None]
        best: tuple[float, tuple[int | None, ...]] = (LEAST_DECADES, ())
        for choice in itertools.product(places, currents, voltages, loads):
            real = [k for k in choice if k is not None]
            if len(set(real)) == len(real):
                best = max(best, (self._merit(*choice), choice), key=lambda row: row[0])
        for number, quantity in zip(best[1], (POSITION, CURRENT, VOLTAGE, FORCE), strict=False):
            if number is not None and self.is_unknown(number):
                self._take(number, quantity, "it fits the equations of a motor best")

    def _is_command(self, number: int) -> bool:
        """Whether it goes with another that has far more noise."""
        own = _noise(self.sources[number].values, 0.0)
        return any(
            explained(self._mean[number], [self._mean[k]]) > LIKE_COMMAND
            and own < LESS_NOISE * _noise(self.sources[k].values, 0.0)
            for k in self.unknown()
            if k != number
        )

    def _merit(self, place: int, current: int, voltage: int | None, load: int | None) -> float:
        """Decades by which the equations of a motor explain what these are taken for."""
        speed, gain = self._rate[place], self._gain[place]
        merit = 0.0
        if voltage is not None:
            by_speed = [explained(self._mean[k], [speed]) for k in (voltage, current)]
            same = explained(self._mean[voltage], [self._mean[current]]) > SAME_SHARE
            # The equations hold for either; the back-EMF is in the voltage.
            if same or by_speed[0] < by_speed[1] or self._follows(load, voltage):
                return -1.0
            merit += _decades(explained(self._mean[voltage], [self._mean[current], speed])) - 0.5
        drag = [np.sign(speed), speed, gain]
        forces = drag if load is None else [*drag, self._mean[load]]
        return merit + _decades(explained(self._mean[current], forces)) - 0.2 * (load is not None)

    def _follows(self, load: int | None, voltage: int) -> bool:
        """Whether a load is rather a second voltage: it explains the current as well."""
        if load is None:
            return False
        return explained(self._mean[load], [self._mean[voltage]]) > SECOND_VOLTAGE

    def others(self) -> None:
        """What goes with a known one, its command or another reading; and a load that is left."""
        for quantity, least in ((POSITION, LIKE), (VOLTAGE, SECOND_VOLTAGE)):
            for known, other in itertools.product(self._are(quantity), self.unknown()):
                share = explained(self._mean[other], [self._mean[known]])
                if self.is_unknown(other) and share > least:
                    self._beside(known, other, quantity)
        places, currents = self._are(POSITION), self._are(CURRENT)
        if places and currents and not self._are(FORCE):
            without = self._merit(places[0], currents[0], None, None)
            gained = {k: self._merit(places[0], currents[0], None, k) for k in self.unknown()}
            best = max(gained, key=lambda k: gained[k], default=-1)
            if gained.get(best, 0.0) > without:
                self._take(best, FORCE, "the current goes with it")

    def _beside(self, known: int, other: int, quantity: str) -> None:
        like = f"it goes with {self.sources[known].name}"
        less = LESS_NOISE * _noise(self.sources[known].values, 0.0)
        if _noise(self.sources[other].values, 0.0) < less:
            self._take(other, quantity, f"{like}, with less noise", COMMANDED)
        elif quantity == POSITION:
            self._take(other, quantity, like, "load")


def moves(values: Array) -> bool:
    """Whether a series has more in it than noise without memory."""
    steps = np.diff(values)
    steps, own = steps[np.isfinite(steps)], values[np.isfinite(values)]
    if len(steps) < 3 or not float(np.var(own)) > 0.0:
        return False
    return float(np.mean(steps * steps)) < 2.0 * WHITE * float(np.var(own))


def _decades(share: float) -> float:
    return -math.log10(max(1.0 - share, 1e-6))


def explained(target: Array, columns: Iterable[Array]) -> float:
    """Share of the variance of one series that others explain, with an offset."""
    table = np.column_stack([*columns, np.ones(len(target))])
    use = np.isfinite(table).all(axis=1) & np.isfinite(target)
    if use.sum() < 4 * table.shape[1]:
        return 0.0
    table, target = table[use], target[use]
    scale = np.linalg.norm(table, axis=0)
    scale[scale == 0.0] = 1.0
    solved = np.linalg.lstsq(table / scale, target, rcond=1e-9)[0]
    variance = float(np.var(target))
    left = target - (table / scale) @ solved
    return 1.0 - float(np.var(left)) / variance if variance > 0.0 else 0.0


def _noise(values: Array, per: float) -> float:
    """Scatter from reading to reading, as a share of the whole; ``per`` 1: of the level."""
    finite = values[np.isfinite(values)]
    second = float(np.std(np.diff(finite, 2)))
    return second / max(float(abs(np.mean(finite)) if per else np.std(finite)), 1e-12)
