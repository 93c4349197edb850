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

"""The tables of the report: each kind of run by itself, diagnosers side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

KINDS = {
    "real": "recorded runs",
    "injected": "recorded runs with an injected software fault",
    "spliced": "recorded runs switched to another unit",
    "simulated": "simulated runs",
}

Part = Mapping[str, Any]


def report_tables(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One table for each source of each kind; its columns are the diagnosers."""
    places: dict[tuple[str, str], list[Part]] = {}
    for part in summary["parts"]:
        places.setdefault((part["source"], part["kind"]), []).append(part)
    return [_table(source, kind, parts) for (source, kind), parts in places.items()]


def _table(source: str, kind: str, parts: Sequence[Part]) -> dict[str, Any]:
    rows = [{row["row"]: row for row in part["rows"]} for part in parts]
    names = list(dict.fromkeys(name for part in rows for name in part))
    first = {name: next(part[name] for part in rows if name in part) for name in names}
    whole = {
        "name": "all",
        "cells": [_cell(part["scores"]["right"]) for part in parts],
        "paper": "",
        "times": "",
    }
    listed = [
        {
            "name": name,
            "cells": [_cell(part[name]) if name in part else None for part in rows],
            "paper": _percent(first[name]["paper"]),
            "times": _times(first[name]["scores"]),
        }
        for name in names
    ]
    return {
        "title": f"{source}: {KINDS[kind]}",
        "configurations": [part["configuration"] for part in parts],
        "paper": kind == "simulated" and any(row["paper"] for row in listed),
        "rows": [*listed, whole],
        "leaders": _leaders(parts) if len(parts) > 1 else [],
        "parts": [_details(part) for part in parts],
    }


def _leaders(parts: Sequence[Part]) -> list[dict[str, str]]:
    """Diagnosers by their mean utility, the metric of the competitions, then by right answers."""

    def rank(part: Part) -> tuple[float, float]:
        utility, right = part["scores"]["utility"], part["scores"]["right"]["percent"]
        return (-math.inf if utility is None else utility), right or 0.0

    return [_leader(part) for part in sorted(parts, key=rank, reverse=True)]


def _leader(part: Part) -> dict[str, str]:
    scores = part["scores"]
    shares = "right", "detection_accuracy", "false_positives", "false_negatives", "component_right"
    detected, cpu = scores["detection_time_s"], scores["cpu_s"]
    return {
        "name": part["configuration"],
        "utility": "" if scores["utility"] is None else f"{scores['utility']:.3f}",
        **{name: _short(scores[name]) for name in shares},
        "detected": "" if detected is None else f"{detected['median']:.2f}",
        "cpu": "" if cpu is None else f"{cpu['mean']:.2f}",
        "runs": str(scores["runs"]),
        "failed": str(scores["failed"]),
    }


def _short(share: Mapping[str, Any]) -> str:
    """Percentage with its interval, without the counts."""
    if share["percent"] is None:
        return ""
    return f"{share['percent']:.1f} ({share['low_percent']:.0f} to {share['high_percent']:.0f})"


def _cell(share: Mapping[str, Any]) -> dict[str, str]:
    return {
        "right": str(share["right"]),
        "count": str(share["count"]),
        "percent": _percent(share),
        "interval": f"{share['low_percent']:.1f} to {share['high_percent']:.1f}",
    }


def _percent(share: Mapping[str, Any] | None) -> str:
    return "" if share is None or share["percent"] is None else f"{share['percent']:.1f} %"


def _times(scores: Mapping[str, Any]) -> str:
    known = (scores["detection_time_s"], scores["isolation_time_s"])
    return ", ".join(f"{each['median']:.2f} s" for each in known if each)


def _details(part: Part) -> dict[str, Any]:
    return {
        "configuration": part["configuration"],
        "metrics": _metrics(part["scores"]),
        "confusion": part["confusion"],
        "ladders": [_ladder(row) for row in part["rows"] if row["ladder"]],
    }


def _metrics(scores: Mapping[str, Any]) -> list[tuple[str, str]]:
    alarms = scores["false_alarms_per_hour"]
    rows = [(name, _share_words(scores[key])) for name, key in _SHARES]
    rows.append(
        (
            "false alarms",
            f"{alarms['alarms']} in {alarms['hours']} h nominal: "
            f"{alarms['low']} to {alarms['high']} per hour (95 %)"
            if alarms["hours"]
            else "no healthy running",
        )
    )
    rows += [(name, _spread_words(scores[key], unit)) for name, key, unit in _SPREADS]
    return rows + [(name, _value_words(scores[key], unit)) for name, key, unit in _VALUES]


_SHARES = (
    ("right", "right"),
    ("right component", "component_right"),
    ("false positives", "false_positives"),
    ("false negatives", "false_negatives"),
    ("detection accuracy", "detection_accuracy"),
    ("listed as not observable", "unseen"),
)
_SPREADS = (
    ("detection time", "detection_time_s", "s"),
    ("isolation time", "isolation_time_s", "s"),
    ("processor time of a run", "cpu_s", "s"),
)
_VALUES = (
    ("classification errors, summed", "classification_errors", ""),
    ("utility, mean", "utility", ""),
    ("size of the final group, mean", "group_size", ""),
    ("features computed, mean", "features_computed", ""),
    ("features skipped, mean", "features_skipped", ""),
    ("times real time", "times_real_time", ""),
    ("peak memory, mean", "peak_memory_mb", "MB"),
)


def _share_words(share: Mapping[str, Any]) -> str:
    cell = _cell(share)
    percent = cell["percent"] or "none"
    return f"{cell['right']} of {cell['count']}: {percent} ({cell['interval']})"


def _spread_words(spread: Mapping[str, Any] | None, unit: str) -> str:
    if spread is None:
        return "none"
    return f"median {spread['median']} {unit}, mean {spread['mean']}, worst {spread['worst']}"


def _value_words(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value} {unit}".strip()


def _ladder(row: Part) -> dict[str, str]:
    ladder = row["ladder"]
    at = ladder["half_at"]
    half = ladder["half"] if at is None else f"{at:.3g} {ladder['unit']}"
    steps = ", ".join(
        f"{step['size']:.3g}: {step['right']}/{step['count']}" for step in ladder["steps"]
    )
    return {"row": row["row"], "half": half, "steps": steps}
