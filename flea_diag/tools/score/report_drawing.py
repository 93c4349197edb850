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

"""The drawing of one run: signals, residuals, symbols, group and features over time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flea_diag.tools.campaign.run_result import NOMINAL, RunResult
from flea_diag.tools.score.report_charts import (
    NAMES,
    Mark,
    group_steps,
    range_words,
    strip,
    symbol_matrix,
    time_axis,
)

RESIDUAL_SHOWN = 0.5
"""A residual that stays below this share of its limit is not drawn."""
MOST_RESIDUALS = 10
SIGNALS = (
    "actuator_position",
    "load_position",
    "motor_speed",
    "load_force",
    "motor_current",
    "motor_voltage",
    "commanded_voltage",
    "motor_temperature",
    "nut_temperature",
    "ambient_temperature",
)


def picture(result: RunResult, trace: Mapping[str, Any]) -> dict[str, Any]:
    """All charts of one run, from what ``run_trace`` kept of it."""
    from markupsafe import Markup

    duration_s = trace["duration_s"]
    marks = _marks(result, trace)
    traces = trace["traces"]
    ordered = [name for name in SIGNALS if name in traces]
    features = [_feature(each) for each in trace["features"]]
    available = max((group["features"][1] for group in trace["groups"]), default=0)
    return {
        "id": result.id,
        "configuration": result.configuration,
        "fold": result.fold,
        "truth": result.truth,
        "right": result.right,
        "words": result.words,
        "marks": "; ".join(f"{words} at {at_s:.2f} s" for at_s, words, _ in marks),
        "verdict": result.failure or verdict(result),
        "group": Markup(group_steps(trace["groups"], duration_s, marks)),
        "symbols": Markup(symbol_matrix(trace["symbols"], duration_s, marks)),
        "features": features,
        "skipped": max(available - len(result.features_computed), 0),
        "residuals": [
            (name, Markup(strip(traces[f"{name}/limit"], duration_s, marks, limit=True)))
            for name in _notable(traces)
        ],
        "signals": [
            (
                f"{name}: {range_words(traces[name])}",
                Markup(strip(traces[name], duration_s, marks, estimate=traces.get(f"{name}/band"))),
            )
            for name in ordered
        ],
        "estimated": any(f"{name}/band" in traces for name in ordered),
        "axis": Markup(time_axis(duration_s)),
        "named_axis": Markup(time_axis(duration_s, NAMES)),
    }


def verdict(result: RunResult, most: int | None = None) -> str:
    """Outcome and final group, of which ``most`` members are named."""
    named, more = result.group[:most], len(result.group[:most]) - len(result.group)
    group = ", ".join(named) + (f" and {-more} more" if more else "")
    return f"{result.outcome}: {group}" if group else result.outcome


def _marks(result: RunResult, trace: Mapping[str, Any]) -> list[Mark]:
    truths = [(at_s, f"truth: {fault}", "truth") for fault, at_s in trace["truth"]]
    onset = [mark for mark in truths if mark[1] != f"truth: {NOMINAL}"]
    if not onset and result.onset_s is not None:
        onset = [(result.onset_s, f"truth: {result.truth}", "truth")]
    return onset + [(at_s, "detected", "detected") for at_s in result.alarms_s]


def _notable(traces: Mapping[str, Any]) -> list[str]:
    """Residuals that came near their limits, the farthest first."""
    reach = {
        name.removesuffix("/limit"): _largest(trace)
        for name, trace in traces.items()
        if name.endswith("/limit")
    }
    near = [name for name, size in reach.items() if size >= RESIDUAL_SHOWN]
    return sorted(near, key=lambda name: -reach[name])[:MOST_RESIDUALS]


def _largest(trace: Mapping[str, Any]) -> float:
    return max((abs(v) for key in ("low", "high") for v in trace[key] if v is not None), default=0)


def _feature(feature: Mapping[str, Any]) -> dict[str, str]:
    low, high = feature["low"], feature["high"]
    return {
        "name": feature["name"],
        "asked": number(feature["asked_s"], "{:.2f} s"),
        "value": feature["reason"] or number(feature["value"], "{:.4g} ") + feature["unit"],
        "nominal": "" if low is None or high is None else f"{low:.4g} to {high:.4g}",
        "symbol": feature["symbol"],
        "cost": number(feature["cost_ms"], "{:.2f} ms"),
    }


def number(value: float | None, form: str) -> str:
    """A number in words, empty where it is not known."""
    return "" if value is None or not math.isfinite(value) else form.format(value)
