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

"""The summary of an evaluation: each kind of run by itself, row by row, with the paper's rates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from flea_diag.formats import stamped
from flea_diag.tools.campaign.campaign import Campaign
from flea_diag.tools.campaign.run_result import KINDS, RunResult
from flea_diag.tools.score.score import component_right, confusion, once, right_share, scores, share
from flea_diag.tools.score.severity import ladder

LISTED = 200
"""Limit of wrong runs named in the summary; the result lines name all."""

PAPER: dict[str, tuple[int, int]] = {
    "Nominal": (133, 134),
    "Current Bias": (15, 15),
    "Current Dead": (15, 15),
    "Current Drift": (15, 15),
    "Position Sensor Failure": (13, 21),
    "Current Scaling": (15, 15),
    "Jam": (10, 15),
    "Motor Failure": (15, 15),
    "Spall": (15, 15),
    "Temp Bias": (15, 15),
    "Temp Dead": (15, 15),
    "Temp Drift": (15, 15),
    "Temp Scaling": (15, 15),
}
"""Correct and all scenarios of each row of Narasimhan et al. 2010, Table 4, on the FLEA."""


def summarise(campaign: Campaign, results: Iterable[RunResult]) -> dict[str, Any]:
    """Summary of all results, by configuration and kind.

    Real, simulated, injected and spliced runs are never added up.
    """
    known = tuple(results)
    seeds = {source.name: getattr(source, "seed", None) for source in campaign.sources}
    parts = []
    for configuration in dict.fromkeys(result.configuration for result in known):
        for kind in KINDS:
            chosen = [r for r in known if (r.kind, r.configuration) == (kind, configuration)]
            parts += [
                {"seed": seeds.get(source), **_part(configuration, kind, source, part)}
                for source, part in _sources(chosen)
            ]
    lost = [
        {"source": part["source"], "row": row["row"], "percent": row["percent"]}
        for part in parts
        for row in part["rows"]
        if part["configuration"] == campaign.configurations[0]
        and row["count"]
        and (row["percent"] or 0.0) < campaign.limit_percent
    ]
    summary = {
        "campaign": campaign.name,
        "dates": sorted({result.date for result in known if result.date}),
        "commits": sorted({result.commit for result in known if result.commit}),
        "runs": len(known),
        "failed": sum(1 for result in known if result.failure),
        "limit_percent": campaign.limit_percent,
        "lost_rows": lost,
        "backends": sorted({result.backend for result in known if result.backend}),
        "parts": parts,
    }
    return stamped("evaluation summary", summary)


def _sources(results: Sequence[RunResult]) -> list[tuple[str, list[RunResult]]]:
    """Runs by the source that they come from: the first part of their names."""
    found: dict[str, list[RunResult]] = {}
    for result in results:
        found.setdefault(result.id.split("/")[0], []).append(result)
    return list(found.items())


def _part(
    configuration: str, kind: str, source: str, results: Sequence[RunResult]
) -> dict[str, Any]:
    rows: dict[str, list[RunResult]] = {}
    for result in results:
        rows.setdefault(result.row, []).append(result)
    wrong = [result for result in once(results) if not result.right and not result.unseen]
    return {
        "configuration": configuration,
        "kind": kind,
        "source": source,
        "rows": [_row(title, row) for title, row in rows.items()],
        "scores": scores(results),
        "confusion": confusion(results),
        "not_right": [_named(result) for result in wrong[:LISTED]],
    }


def _row(title: str, results: Sequence[RunResult]) -> dict[str, Any]:
    runs = once(results)
    found = scores(results)
    paper = PAPER.get(title)
    faulty = [result for result in runs if result.faulty and not result.unseen]
    return {
        "row": title,
        **right_share(runs),
        "unseen": found["unseen"],
        "by_design": sum(r.by_design for r in runs),
        "component": share(sum(component_right(r) for r in faulty), len(faulty)),
        "detected": share(sum(r.detected for r in faulty), len(faulty)),
        "paper": None if paper is None else share(*paper),
        "scores": found,
        "ladder": ladder(results),
    }


def _named(result: RunResult) -> dict[str, Any]:
    return {
        "id": result.id,
        "fold": result.fold,
        "truth": result.truth,
        "size": result.size,
        "onset_s": result.onset_s,
        "outcome": result.outcome,
        "group": list(result.group),
        "alarms_s": list(result.alarms_s),
        "failure": result.failure,
        "why": _why(result),
    }


def _why(result: RunResult) -> str:
    """Why a run is not right."""
    if result.failure:
        return "failed"
    if result.false_alarms:
        return "false alarm"
    if not result.expected:
        return "alarm, none expected" if result.alarms_s else f"outcome {result.outcome}"
    if not result.detected:
        return "not detected"
    if result.truth in result.group:
        return "group too large"
    return "truth not in the group"


def tables(summary: dict[str, Any]) -> str:
    """The summary as text, one table for each kind, source and configuration."""
    lines = [f"{summary['campaign']}: {summary['runs']} runs, {summary['failed']} failed"]
    for part in summary["parts"]:
        lines += ["", *_table(part)]
    for row in summary["lost_rows"]:
        lines.append(
            f"below the limit: {row['source']}, {row['row']}: {row['percent']} % right, limit "
            f"{summary['limit_percent']} %"
        )
    return "\n".join(lines)


def _table(part: dict[str, Any]) -> list[str]:
    whole = part["scores"]
    lines = [
        f"{part['source']} ({part['kind']}, {part['configuration']})",
        f"  {'row':28} {'right':>11} {'%':>6} {'95 % interval':>15} {'component':>10} "
        f"{'paper %':>8}  detected, isolated after (median)",
    ]
    lines += [f"  {_line(row)}" for row in part["rows"]]
    total = whole["right"]
    alarms = whole["false_alarms_per_hour"]
    lines.append(f"  {'all':28} {_counted(total)}")
    lines.append(
        f"  detection accuracy {whole['detection_accuracy']['percent']} %, false alarms "
        f"{alarms['alarms']} in {alarms['hours']} h ({alarms['low']} to {alarms['high']} per "
        f"hour), classification errors {whole['classification_errors']}, utility "
        f"{whole['utility']}, group {whole['group_size']}, features {whole['features_computed']} "
        f"of {_sum(whole['features_computed'], whole['features_skipped'])}, "
        f"{whole['times_real_time']:g} times real time, {whole['peak_memory_mb']} MB"
    )
    return lines


def _sum(one: float | None, other: float | None) -> float:
    return round((one or 0.0) + (other or 0.0), 2)


def _counted(row: dict[str, Any]) -> str:
    count = f"{row['right']} of {row['count']}"
    interval = f"{row['low_percent']:.1f} to {row['high_percent']:.1f}"
    percent = "-" if row["percent"] is None else f"{row['percent']:.1f}"
    return f"{count:>11} {percent:>6} {interval:>15}"


def _line(row: dict[str, Any]) -> str:
    component = row["component"]
    inside = f"{component['right']}/{component['count']}" if component["count"] else ""
    paper = f"{row['paper']['percent']:.1f}" if row["paper"] else ""
    times = [row["scores"][key] for key in ("detection_time_s", "isolation_time_s")]
    after = ", ".join(f"{each['median']:.2f} s" for each in times if each)
    if row["unseen"]["right"]:
        after += f"{row['unseen']['right']} listed as not observable"
    if row["by_design"]:
        after += f"; {row['by_design']} more in a group that cannot be split, by design"
    return f"{row['row']:28} {_counted(row)} {inside:>10} {paper:>8}  {after}"
