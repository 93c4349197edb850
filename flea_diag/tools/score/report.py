"""An evaluation as one HTML page that needs nothing else: no network, no server, no script library.

What is read: the results, one a run, and the traces of those runs that are to be drawn.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any

from flea_diag.tools.campaign.run_result import NOMINAL, RunResult
from flea_diag.tools.extra import require
from flea_diag.tools.score.report_charts import (
    NAMES,
    Mark,
    group_steps,
    range_words,
    strip,
    symbol_matrix,
    time_axis,
)
from flea_diag.tools.score.report_tables import report_tables

COLUMNS = (
    "run",
    "kind",
    "diagnoser",
    "truth",
    "judged",
    "answer",
    "detected after (s)",
    "final after (s)",
    "features",
    "CPU (s)",
)
WIDE = ("kind", "diagnoser", "features", "CPU (s)")
"""Columns that a phone leaves out."""
MOST_DRAWN = 400
"""Runs drawn; each is about 70 kB of the page."""
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

Summary = Mapping[str, Any]
Traces = Callable[[RunResult], Mapping[str, Any] | None]


def to_draw(results: Sequence[RunResult], most: int = MOST_DRAWN) -> list[RunResult]:
    """Runs that get a picture: those that are wrong first, then of each row in turn."""
    seen: Counter[tuple[str, str, str]] = Counter()
    ranked = []
    for result in results:
        if not result.failure:
            row = result.kind, result.row, result.configuration
            seen[row] += result.right
            ranked.append((seen[row] if result.right else 0, result))
    ranked.sort(key=lambda entry: entry[0])
    return [result for _, result in ranked[:most]]


def page(
    title: str,
    made: str,
    results: Sequence[RunResult],
    summary: Summary,
    traces: Traces,
    most: int = MOST_DRAWN,
) -> str:
    """The whole page.

    Parameters
    ----------
    made
        When, and of what.
    summary
        As ``score_summary.summarise`` gives it.
    traces
        Gives what ``run_trace`` kept of a run, None where nothing was kept.
    most
        Runs drawn at most.

    Raises
    ------
    ConfigurationError
        Jinja2 is not installed.
    """
    require("evaluate", "the report")
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=True)
    source = files("flea_diag.tools.score").joinpath("templates/report.html").read_text("utf-8")
    drawn = [(r, trace) for r in to_draw(results, most) if (trace := traces(r)) is not None]
    return environment.from_string(source).render(
        title=title,
        made=made,
        summary=summary,
        tables=report_tables(summary),
        columns=COLUMNS,
        wide=WIDE,
        results=[_line(result) for result in results],
        drawn={anchor(result) for result, _ in drawn},
        drawn_words=f"{len(drawn)} of {len(results)} runs are drawn, those judged wrong first.",
        pictures=(picture(result, trace) for result, trace in drawn),
    )


def anchor(result: RunResult) -> str:
    """Name of the run's drawing on the page."""
    return "run-" + "-".join(part.replace(" ", "_") for part in result.key if part)


def _line(result: RunResult) -> dict[str, Any]:
    return {
        **asdict(result),
        "right": result.right,
        "anchor": anchor(result),
        "detection": _number(result.detection_time_s, "{:.2f}"),
        "isolation": _number(result.isolation_time_s, "{:.2f}"),
        "features": f"{len(result.features_computed)}",
        "cpu": f"{result.cpu_s:.2f}",
    }


def picture(result: RunResult, trace: Mapping[str, Any]) -> dict[str, Any]:
    """All charts of one run."""
    from markupsafe import Markup

    duration_s = trace["duration_s"]
    marks = _marks(result, trace)
    traces = trace["traces"]
    ordered = [name for name in SIGNALS if name in traces]
    features = [_feature(each) for each in trace["features"]]
    available = max((group["features"][1] for group in trace["groups"]), default=0)
    return {
        **_line(result),
        "marks": "; ".join(f"{words} at {at_s:.2f} s" for at_s, words, _ in marks),
        "verdict": result.failure or _verdict(result),
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


def _verdict(result: RunResult) -> str:
    return " ".join([result.outcome, ", ".join(result.group)]).strip()


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
        "asked": _number(feature["asked_s"], "{:.2f} s"),
        "value": feature["reason"] or _number(feature["value"], "{:.4g} ") + feature["unit"],
        "nominal": "" if low is None or high is None else f"{low:.4g} to {high:.4g}",
        "symbol": feature["symbol"],
        "cost": _number(feature["cost_ms"], "{:.2f} ms"),
    }


def _number(value: float | None, form: str) -> str:
    return "" if value is None or not math.isfinite(value) else form.format(value)
