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

"""What a recording says of its stand: template, channels, units, signs, ranges and rates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from flea_diag.core.calibration.power_balance import fitted, rate_of, smoothed
from flea_diag.core.symbolic.converted_unit import CONVERTED
from flea_diag.errors import RecordingError
from flea_diag.tools.series.time_base import bridged_s
from flea_diag.tools.stand_folder.behaviour import moves
from flea_diag.tools.stand_folder.channel_choice import ChosenChannel, GivenChannel
from flea_diag.tools.stand_folder.sign_choice import SignGuess, guessed_signs
from flea_diag.tools.stand_folder.template import Template, fitting_template, has_supply_current
from flea_diag.tools.stand_folder.unit_choice import (
    UnitGuess,
    factor_to_si,
    guessed_units,
    is_stand_in,
)
from flea_diag.tools.stand_folder.unit_relations import unit_relations
from flea_diag.wire.sources.mapping import AGE_READINGS

if TYPE_CHECKING:
    from flea_diag.tools.series.reading_grid import ReadingGrid
    from flea_diag.tools.series.series_sum import SeriesSum

Array = npt.NDArray[np.float64]

SLOW = 5.0
"""Scans for each reading from which on a channel is held instead of interpolated."""
TRAVEL_MARGIN, RANGE_FACTOR = 1.0, 5.0
"""Beyond what was seen, with room for faults: share of the way, multiple of the largest reading."""
LEAST_CONFIDENCE = 0.4
"""Confidence below which a channel is not taken."""
TIE = 0.5
"""Confidence in the unit of a position where two templates fit equally."""
UNSURE = 0.65
"""Confidence below which a source is to be checked."""
SAME_RATE = 0.05
"""Share by which readings may come at another rate than scans without a word."""
ROOM_DEGC = (-20.0, 150.0)


@dataclass(frozen=True, eq=False)
class ChannelProposal:
    """One channel of channels.yaml.

    ``guesses`` are a sentence each, ``doubts`` to be checked; ``confidence`` is the chance that
    source and unit are right. ``age_s`` is 0 where the usual one will do, ``turn`` where the
    reading is no angle that begins anew.
    """

    channel: str
    source: SeriesSum
    unit: str
    sign: int
    scale: float
    low: float
    high: float
    rate_hz: float
    hold: bool
    guesses: tuple[str, ...]
    doubts: tuple[str, ...]
    confidence: float = 1.0
    age_s: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True, eq=False)
class StandProposal:
    """All that is written into the folder of a stand."""

    template: Template
    grid: ReadingGrid
    channels: tuple[ChannelProposal, ...]
    travel: tuple[float, float] | None
    rivals: tuple[str, ...] = ()
    doubtful: tuple[ChosenChannel, ...] = ()
    moves: bool = True

    @property
    def rate_hz(self) -> float:
        """Rate of the scans."""
        return 1.0 / self.grid.period_s

    @property
    def unused(self) -> tuple[tuple[str, str], ...]:
        """Series that are no channel, with the reason."""
        used = {series for each in self.channels for series, _ in each.source.terms}
        left = [s for s in self.grid.sources if len(s.terms) == 1 and s.terms[0][0] not in used]
        words = "fits no channel of this description"
        doubtful = tuple(
            (each.source.name, f"{each.channel} by {each.confidence:.0%}, too little to take it")
            for each in self.doubtful
        )
        names = {name for name, _ in doubtful}
        left = [each for each in left if each.name not in names]
        return (*doubtful, *((each.name, words) for each in left), *self.grid.unused)


def proposal(
    grid: ReadingGrid,
    wanted: str = "",
    given: Mapping[str, GivenChannel] = MappingProxyType({}),
) -> StandProposal:
    """Read a stand off a recording.

    Parameters
    ----------
    grid
        The recording.
    wanted
        Name of the template; "": the one that fits.
    given
        Channels whose sources are known.

    Raises
    ------
    RecordingError
        A channel that the template needs can be told with too little confidence.
    """
    fit = fitting_template(grid, wanted, given)
    kind, chosen = fit.template, fit.channels
    doubtful = tuple(each for each in chosen if each.confidence < LEAST_CONFIDENCE)
    _check_needed(grid, kind, doubtful)
    chosen = tuple(each for each in chosen if each.confidence >= LEAST_CONFIDENCE)
    units = guessed_units(chosen, unit_relations(chosen, grid.period_s), grid.times is None)
    signs = guessed_signs(chosen, grid.period_s)
    scales = _scales(chosen, units, grid.period_s, kind)
    supply = bool(has_supply_current(chosen, grid.period_s))
    rows = tuple(
        _row(each, units[each.channel], signs[each.channel], scales.get(each.channel), supply, grid)
        for each in chosen
    )
    if fit.rivals:
        rows = tuple(
            _of_two_kinds(row, each.si_unit) for row, each in zip(rows, chosen, strict=True)
        )
    places = [each.source.values for each in chosen if each.si_unit in ("m", "rad")]
    is_moving = any(map(moves, places))
    if not is_moving:
        rows = tuple(replace(row, doubts=_all_but_temperature(row)) for row in rows)
    return StandProposal(kind, grid, rows, _travel(rows, chosen), fit.rivals, doubtful, is_moving)


def _of_two_kinds(row: ChannelProposal, si_unit: str) -> ChannelProposal:
    """A position or speed of a recording that fits a part that slides and one that turns."""
    if si_unit not in ("m", "rad", "m/s", "rad/s") or "its name says so" in row.guesses[1]:
        return row
    more = () if any(d.startswith("unit") for d in row.doubts) else ("unit",)
    return replace(row, doubts=(*row.doubts, *more), confidence=min(row.confidence, TIE))


def _all_but_temperature(row: ChannelProposal) -> tuple[str, ...]:
    """Doubts of a channel whose recording has no motion."""
    more = [] if any(d.startswith("sign") for d in row.doubts) else ["sign"]
    return (*row.doubts, *(more if "temperature" not in row.channel else ()))


def _check_needed(grid: ReadingGrid, kind: Template, doubtful: tuple[ChosenChannel, ...]) -> None:
    for each in doubtful:
        if each.channel in kind.needs:
            others = f", {', '.join(each.rivals[:5])} would do as well" if each.rivals else ""
            raise RecordingError(
                f"{grid.recorded.path}: {each.channel} would be {each.source.name}, because "
                f"{each.because}, with a confidence of {each.confidence:.0%}{others}; at least "
                f"{LEAST_CONFIDENCE:.0%} are needed: say which it is, --channel {each.channel}=NAME"
            )


def _scales(
    chosen: tuple[ChosenChannel, ...], units: dict[str, UnitGuess], period_s: float, kind: Template
) -> dict[str, tuple[float, str]]:
    """Factor and reason for the speed of the moved part, where that of the motor is described."""
    moved = next((e for e in chosen if e.si_unit in ("m", "rad")), None)
    found = {}
    for each in chosen:
        if each.si_unit != "rad/s" or moved is None or not kind.way_per_turn:
            continue
        speed = smoothed(each.source.values, period_s)
        rate = rate_of(smoothed(moved.source.values, period_s), period_s)
        ((slope, _),) = fitted(speed, [rate], 10.0)
        unit, place = units[each.channel].unit, units[moved.channel].unit
        ratio = abs(slope) * factor_to_si(unit) / factor_to_si(place)
        linear = CONVERTED.get(unit, (unit,))[0] == "m/s"
        own = abs(math.log(max(ratio, 1e-9))) < 0.05
        if linear or (own and moved.si_unit == "rad" and kind.way_per_turn < 0.5):
            words = f"it is the speed of the moved part, one turn of the motor in {_turn(kind)}"
            found[each.channel] = (1.0 / kind.way_per_turn, words)
    return found


def _turn(kind: Template) -> str:
    return f"{2.0 * math.pi * kind.way_per_turn:.4g} m or rad by the description"


def _row(
    each: ChosenChannel,
    unit: UnitGuess,
    sign: SignGuess,
    scale: tuple[float, str] | None,
    supply: bool,
    grid: ReadingGrid,
) -> ChannelProposal:
    supply = supply and each.si_unit == "A"
    if supply and not sign.sure:
        sign = SignGuess(1, "it never turns with the direction: the current of a supply")
    guesses = [f"source: {each.because}", f"unit: {unit.because}", f"sign: {sign.because}"]
    doubts = []
    if unit.other:
        doubts.append(f"unit {unit.unit} or {unit.other}")
    elif is_stand_in(each):
        doubts.append("unit")
    if not sign.sure:
        doubts.append("sign")
    if each.merit < 0.65 or each.source.because or each.confidence < UNSURE:
        others = f"{each.source.name} or {each.rivals[0]}" if each.rivals else ""
        doubts.append(f"source {others}".rstrip())
    factor = 1.0
    written = unit.unit
    if scale is not None:
        factor = scale[0]
        if CONVERTED.get(written, (written,))[0] == "m/s":
            factor, written = factor * factor_to_si(written), each.si_unit
        guesses.append(f"scale: {scale[1]}")
        doubts.append("scale")
    low, high = _range(each, written, sign.sign * factor, supply)
    scan_hz, own_hz = 1.0 / grid.period_s, each.source.rate_hz
    rate_hz = own_hz if math.isfinite(own_hz) else scan_hz
    if abs(rate_hz - scan_hz) < SAME_RATE * scan_hz:
        rate_hz = scan_hz
    usual_s = AGE_READINGS / rate_hz
    bridged = max(bridged_s(series) for series, _ in each.source.terms)
    age_s = float(f"{bridged:.3g}") if bridged > 1.1 * usual_s else 0.0
    return ChannelProposal(
        each.channel,
        each.source,
        written,
        sign.sign,
        factor,
        low,
        high,
        rate_hz,
        rate_hz * SLOW <= scan_hz,
        tuple(guesses),
        tuple(doubts),
        min(each.confidence, unit.confidence),
        age_s,
        each.source.turn,
    )


def in_si(values: Array, unit: str, factor: float) -> Array:
    """Readings in SI; ``factor`` holds sign and scale."""
    _, to_si, offset = CONVERTED.get(unit, (unit, 1.0, 0.0))
    return np.asarray(to_si * factor * values + offset)


def _range(each: ChosenChannel, unit: str, factor: float, one_way: bool) -> tuple[float, float]:
    """A range that readings of other runs of this stand should keep, too."""
    values = in_si(each.source.values[np.isfinite(each.source.values)], unit, factor)
    low, high = float(values.min()), float(values.max())
    if each.si_unit == "degC":
        return min(ROOM_DEGC[0], round(low) - 20.0), max(ROOM_DEGC[1], round(high) + 50.0)
    if each.si_unit in ("m", "rad"):
        # What stands still in this recording moves in others.
        margin = TRAVEL_MARGIN * (high - low) or RANGE_FACTOR * abs(high) or 1.0
        return _rounded(low - margin, -1), _rounded(high + margin, 1)
    most = RANGE_FACTOR * max(abs(low), abs(high)) or 1.0
    if one_way:
        return _rounded(-0.4 * most, -1), _rounded(2.0 * most, 1)
    return _rounded(-most, -1), _rounded(most, 1)


def _rounded(value: float, way: int) -> float:
    """The next number of two digits, away from the readings."""
    if value == 0.0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    whole = math.ceil(value / step) if way > 0 else math.floor(value / step)
    return float(f"{whole * step:.6g}")


def _travel(
    rows: tuple[ChannelProposal, ...], chosen: tuple[ChosenChannel, ...]
) -> tuple[float, float] | None:
    """Ends of travel: no nearer than the range of the first position."""
    units = {each.channel: each.si_unit for each in chosen}
    return next(((r.low, r.high) for r in rows if units[r.channel] in ("m", "rad")), None)
