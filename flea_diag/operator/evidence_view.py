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

"""Evidence: residuals against their limits, symbols, features, the size of a fault over time."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flea_diag.operator.panel import Line, Panel, bar, clock
from flea_diag.operator.quantity import SIGMA, decimals, number, statistic, unit_of
from flea_diag.operator.state import OPEN, OperatorState, SymbolChange
from flea_diag.operator.words import later, tr
from flea_diag.wire.records import NEVER_NS, FeatureValue, Level, SizeTrend, Symbol

MOST_SIZES = 6
MINUTE_S = 60.0
MORE_LIKELY = 0.5
DIRECTIONS = (later("grows"), later("shrinks"), later("no trend is shown"))
"""Words of ``core/prognosis/trend.py``."""


def residuals(state: OperatorState) -> Panel | None:
    """Each residual relative to its limit: those that deviate in the open episode, then the rest.

    The order is that of the record within both, so that no line moves while it is read.
    """
    record = state.residual
    if record is None:
        return None
    rows = list(zip(record.names, record.z, record.thresholds, strict=True))
    deviating = {entry.symbol.residual for entry in _of_episode(state)}
    rows.sort(key=lambda row: row[0] not in deviating)
    formed = sum(not math.isnan(z) for _, z, _ in rows)
    at = clock(record.stamp_ns)
    told = tr("beside their limits, {formed} of {count} formed", formed=formed, count=len(rows))
    title = f"{tr('RESIDUALS')} {told}, {at} UTC"
    return Panel("residuals", title, tuple(_residual(*row) for row in rows))


def _share(z: float, limit: float) -> float:
    """|z| divided by its limit; below 0 where either is unknown."""
    return -1.0 if math.isnan(z) or math.isnan(limit) or limit <= 0.0 else abs(z) / limit


def _residual(name: str, z: float, limit: float) -> Line:
    if math.isnan(z):
        return Line(f"{name:32} {bar(math.nan)}  {tr('not formed')}")
    if _share(z, limit) < 0.0:
        return Line(f"{name:32} {bar(math.nan)}  {decimals(z)}, {tr('no limit')}")
    beyond = abs(z) > limit
    unit = unit_of(name, limit)
    told = statistic(name, z, limit)
    if unit == SIGMA:
        told = tr("{z:+.2f} σ of {limit:.2f}", z=z, limit=limit)
    text = f"{name:32} {bar(abs(z) / limit)}| {told}"
    return Line(text + (f" {tr('BEYOND')}" if beyond else ""), Level.WARN if beyond else None)


def symbols(state: OperatorState) -> Panel | None:
    """Symbols of the open episode: the latest of each residual with its history."""
    flag = state.detection
    if flag is None or not flag.detected:
        return None
    past: dict[str, list[Symbol]] = {}
    for change in _of_episode(state):
        past.setdefault(change.symbol.residual, []).append(change.symbol)
    lines = tuple(_symbol(residual, rows) for residual, rows in past.items())
    first = (
        f"{tr('SYMBOLS')}  "
        f"{tr('first {residual} at {at} UTC', residual=flag.residual, at=clock(flag.stamp_ns))}: "
        f"{statistic(flag.residual, flag.z, flag.threshold)} ({flag.test})"
    )
    return Panel("symbols", first, lines)


def _of_episode(state: OperatorState) -> list[SymbolChange]:
    """Changes of symbols of the open episode."""
    flag = state.detection
    if flag is None or not flag.detected:
        return []
    return [
        change
        for change in state.symbols
        if change.episode == flag.episode and change.stamp_ns >= flag.stamp_ns
    ]


def _symbol(residual: str, rows: list[Symbol]) -> Line:
    course = " → ".join(f"{row.magnitude}{row.slope}" for row in rows)
    return Line(f"{residual:26} {course}  {tr('since')} {clock(rows[-1].since_ns)}")


def features(state: OperatorState) -> Panel | None:
    """Features of the open episode: computed, not computable, requested, not requested."""
    group = state.group
    if group is None or not group.features_available:
        return None
    ours = [feature for feature in state.features if feature.episode == group.episode]
    lines = [
        Line(f"{entry.name:28} {tr('requested {at} UTC, no answer yet', at=clock(entry.asked_ns))}")
        if entry.value is None
        else _feature(entry.value)
        for entry in ours
    ]
    seen = {entry.name for entry in ours}
    lines += [
        Line(f"{name:28} {tr('computed before this screen started')}")
        for name in group.features_computed
        if name not in seen
    ]
    tried = seen | set(group.features_computed)
    told = tr(
        "{done} of {count} computed, {rest} not requested",
        done=len(group.features_computed), count=group.features_available,
        rest=max(group.features_available - len(tried), 0),
    )  # fmt: skip
    return Panel("features", f"{tr('FEATURES')}  {told}", tuple(lines))


def _feature(value: FeatureValue) -> Line:
    if math.isnan(value.value):
        why = tr("not computable: {reason}", reason=value.reason)
        return Line(f"{value.feature:28} {why}", Level.WARN)
    nominal = tr(
        "nominal {low} to {high}", low=number(value.nominal_low), high=number(value.nominal_high)
    )
    return Line(
        f"{value.feature:28} {number(value.value, value.unit)}  {value.symbol}"
        f"  ({nominal}, {number(value.cost_ms, 'ms')})"
    )


def followed(state: OperatorState) -> SizeTrend | None:
    """Of the open episode; None while it has no size yet, or another episode is open."""
    trend, group = state.trend, state.group
    if trend is None or group is None or group.outcome not in OPEN:
        return None
    return trend if trend.episode == group.episode else None


def growth(state: OperatorState) -> Panel | None:
    """Sizes over time, the latest last, with their growth and what it leads to."""
    trend = followed(state)
    if trend is None:
        return None
    title = f"{tr('SIZE OVER TIME')}  {trend.fault}, {trend.quantity}"
    lines = [Line(words, level_of(trend)) for words in said(trend)]
    lines += [
        Line(f"{clock(at.at_ns)} {number(at.size, trend.unit, at.sigma)}")
        for at in trend.sizes[-MOST_SIZES:]
    ]
    return Panel("growth", title, tuple(lines))


def level_of(trend: SizeTrend) -> Level:
    """An error once the limit is more likely crossed than not, a warning while that is ahead."""
    if trend.crossed > MORE_LIKELY:
        return Level.ERROR
    return Level.OK if trend.median_ns == NEVER_NS else Level.WARN


def said(trend: SizeTrend) -> Iterator[str]:
    """Level and growth in one line, the limit in another."""
    level = number(trend.level, trend.unit, trend.level_sigma)
    words = f"{level}, {tr(trend.direction)}"
    if not math.isnan(trend.slope_per_s):
        slope, sigma = trend.slope_per_s * MINUTE_S, trend.slope_sigma_per_s * MINUTE_S
        words += f": {tr('{slope} a minute', slope=number(slope, trend.unit, sigma))}"
    yield words
    if math.isnan(trend.limit):
        yield tr("no limit is stated in the fault catalogue: no end is foretold")
        return
    limit = number(trend.limit, trend.unit)
    if trend.crossed > MORE_LIKELY:
        yield tr(
            "limit {limit} is crossed, with probability {share:.0%}",
            limit=limit, share=trend.crossed,
        )  # fmt: skip
    elif trend.median_ns != NEVER_NS:
        yield tr(
            "limit {limit} reached at {at} UTC, 90 %: {low} to {high}",
            limit=limit, at=clock(trend.median_ns), low=clock(trend.low_ns), high=_end(trend),
        )  # fmt: skip
    else:
        yield tr("limit {limit}: no end is foretold", limit=limit)


def _end(trend: SizeTrend) -> str:
    return tr("never") if trend.high_ns == NEVER_NS else clock(trend.high_ns)
