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

"""Trend and remaining life of one size of one fault of one unit, as numbers and as words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flea_diag.core.prognosis.forecast import LEAST_RECORDINGS, Forecast, forecast
from flea_diag.core.prognosis.growth_law import GrowthLaw
from flea_diag.core.prognosis.size_series import SizeSeries, against_new, falls
from flea_diag.core.prognosis.trend import Trend, further_needed, trend
from flea_diag.core.vibration.nominal_range import SPEED_UNIT_RAD_S
from flea_diag.tools.replay.size_estimates import Estimate

DAY_S = 86400.0
LIKE = 1.25
"""Largest by smallest load of recordings up to which impacts are compared without a word: those in
proportion to the root of the load then change by 12 %, about as much as one is known by."""
CROSSED = 0.5
"""Probability from which on a limit is said to be crossed already."""


@dataclass(frozen=True, eq=False)
class UnitTrend:
    """Estimates in the order of time, at least one, all of one unit, fault and size.

    ``new`` are of the same while the unit was new; ``limit`` is the end of life, infinite: none.
    """

    all: Sequence[Estimate]
    new: Sequence[Estimate]
    limit: float
    laws: Sequence[GrowthLaw]

    @cached_property
    def calibrations(self) -> int:
        """By how many the sizes were estimated; what a unit differs by is of one."""
        known = {e.calibration_sha256 for e in (*self.all, *self.new) if e.calibration_sha256}
        return max(len(known), 1)

    @cached_property
    def _fallen(self) -> list[int]:
        return falls(self._series_of(self.all)) if len(self.all) > 1 else []

    @cached_property
    def used(self) -> Sequence[Estimate]:
        """Those since the last repair."""
        return self.all[self._fallen[-1] :] if self._fallen else self.all

    def _series_of(self, entries: Sequence[Estimate]) -> SizeSeries:
        errors = [entry.error for entry in entries]
        times = [(entry.stamp_ns - self.all[0].stamp_ns) / 1e9 for entry in entries]
        return SizeSeries.of(times, [entry.size for entry in entries], errors)

    @cached_property
    def series(self) -> SizeSeries:
        """Sizes of those that are used, against the new unit where it was recorded."""
        series = self._series_of(self.used)
        return against_new(series, self._series_of(self.new)) if self.new else series

    @cached_property
    def line(self) -> Trend:
        """The straight line; without a slope where calibrations differ."""
        last = slice(-1, None) if self.calibrations > 1 else slice(None)
        return trend(self.series.part(last))

    @cached_property
    def forecast(self) -> Forecast | None:
        """How it goes on; None where no growth is shown, or recordings are too few."""
        return forecast(self.series, self.laws) if self.line.direction == "grows" else None

    @cached_property
    def crossing(self) -> dict[str, Any] | None:
        """When the limit is reached, in seconds after the first estimate, and probabilities."""
        if self.forecast is None or math.isinf(self.limit):
            return None
        told = asdict(self.forecast.crossing(self.limit))
        return {name: known(value) for name, value in told.items()}

    def to_mapping(self) -> dict[str, Any]:
        """Plain mapping; ``times`` and ``data`` have the format of progpy's SimResult."""
        first, line, series = self.all[0], self.line, self.series
        return {
            "serial": first.serial,
            "fault": first.fault,
            "quantity": first.quantity,
            "unit": first.unit,
            "since_ns": first.stamp_ns,
            "times": series.times.tolist(),
            "data": [{"size": size} for size in series.sizes.tolist()],
            "sigmas": np.sqrt(np.diagonal(series.covariance())).tolist(),
            "own_sigmas": series.own.tolist(),
            "level": line.level,
            "level_sigma": line.level_sigma,
            "slope_per_s": known(line.slope),
            "slope_sigma_per_s": known(line.slope_sigma),
            "direction": line.direction,
            "laws": self.forecast.of_laws if self.forecast else {},
            "crossing": self.crossing,
            "remarks": self.remarks(),
            "estimates": [entry.row() for entry in self.all],
        }

    def words(self) -> str:
        """The trend in a line, the forecast in the next, and what qualifies them."""
        first, line = self.all[0], self.line
        count = line.estimates
        of = f" {first.quantity}" if first.quantity else ""
        head = f"{first.serial:12} {first.fault:26}{of}"
        unit = self._unit
        level = f"{line.level:.3g} ± {line.level_sigma:.2g}{unit}"
        said = f"{head} {level}, {count} estimate{'s' if count > 1 else ''}: "
        if math.isnan(line.slope):
            said += "no trend without time"
        else:
            slope, sigma = line.slope * DAY_S, line.slope_sigma * DAY_S
            said += f"{slope:+.3g} ± {sigma:.2g}{unit} a day, {line.direction}"
        return "\n  ".join((said, *self._foretold(), *self.remarks()))

    def _foretold(self) -> list[str]:
        if self.forecast is None:
            return []
        laws = ", ".join(f"{name} {share:.2f}" for name, share in self.forecast.of_laws.items())
        said = [f"growth by probability: {laws}"]
        if self.crossing is not None:
            said.append(_crossing(self.crossing, self._unit, self._now_s))
        return said

    @property
    def _unit(self) -> str:
        """Unit as it is said after a number; of a share nothing."""
        unit = self.all[0].unit
        return "" if unit == "1" else f" {unit}"

    @property
    def _now_s(self) -> float:
        return float(self.series.times[-1])

    def remarks(self) -> list[str]:
        """What qualifies the trend, and what is needed for more; one line each."""
        said = []
        if self.calibrations > 1:
            said.append(
                f"sizes by {self.calibrations} calibrations, whose errors of the unit differ: no "
                "trend over them; --calibration FILE diagnoses all bags by one"
            )
        if self._fallen:
            said.append(self._repair())
        if all(math.isnan(entry.size_sigma_own) for entry in self.all):
            said.append(
                "what of the errors the recordings share is not recorded in these verdicts: all is "
                "taken as of each by itself; --calibration FILE diagnoses them again and tells it"
            )
        needed = self._needed()
        return [*said, *self._of_impacts(), *([needed] if needed else [])]

    def _of_impacts(self) -> list[str]:
        """What an amplitude of impacts is, and whether recordings are alike enough for it."""
        loads = [e.load_n for e in (*self.used, *self.new) if math.isfinite(e.load_n)]
        if not loads:
            return []
        said = [
            f"a condition indicator: the amplitude of impacts at {SPEED_UNIT_RAD_S:g} rad/s of the "
            "motor, in proportion to a pit; how large that is in mm it does not say"
        ]
        low, high = min(loads), max(loads)
        if high > LIKE * low:
            said.append(
                f"impacts grow with the load, and these recordings have loads of {low:.3g} to "
                f"{high:.3g} N: like recordings show growth earlier, and none that is not there"
            )
        return said

    def _repair(self) -> str:
        before, after = self.all[self._fallen[-1] - 1], self.all[self._fallen[-1]]
        return (
            f"between {before.bag} and {after.bag} the size falls from {before.size:.3g} to "
            f"{after.size:.3g}{self._unit}, which is no growth: taken as a repair, and the trend "
            f"is of the {len(self.used)} since"
        )

    def _needed(self) -> str:
        """What a trend or a forecast lacks; empty where both are there."""
        if self.calibrations > 1:
            return ""
        if math.isnan(self.line.slope):
            return (
                f"a trend needs 2 recordings at different times, a forecast {LEAST_RECORDINGS} "
                "with growth"
            )
        if self.line.direction == "no trend is shown":
            more = further_needed(self.series, self.line)
            after = "more than 50" if more is None else f"{more}"
            return f"growth at this rate would be shown after {after} more recordings like these"
        if self.line.direction == "grows" and self.forecast is None:
            return f"a forecast needs {LEAST_RECORDINGS} recordings"
        return ""


def known(value: float) -> float | None:
    """None for what is not finite: JSON has no such number."""
    return value if math.isfinite(value) else None


def _crossing(of: dict[str, Any], unit: str, now_s: float) -> str:
    limit = f"limit {of['limit']:.3g}{unit}"
    if of["crossed"] > CROSSED:
        return f"{limit} is crossed already, with probability {of['crossed']:.2f}"
    if of["median_s"] is None:
        return f"{limit} is never reached, with probability {of['never']:.2f}"
    low, median, high = (
        "never" if of[key] is None else f"{max(of[key] - now_s, 0.0) / DAY_S:.3g}"
        for key in ("low_s", "median_s", "high_s")
    )
    return (
        f"{limit} is reached {median} days after the last recording (90 %: {low} to {high}), never "
        f"with probability {of['never']:.2f}"
    )
