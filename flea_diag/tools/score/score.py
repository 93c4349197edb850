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

"""The metrics of the diagnosis competitions (DXC), for single faults.

A diagnosis is a set of candidates with weights that sum to one; a candidate is a set of faults,
here of one fault, or empty without a detection. Sources: T. Kurtoglu et al., First International
Diagnosis Competition, DX-09; A. Feldman et al., Int. J. PHM 1 (2010).
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from flea_diag.errors import InputError
from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.interval import rate_interval, wilson

NONE = frozenset[str]()
Candidates = Sequence[tuple[frozenset[str], float]]


def candidates(result: RunResult) -> Candidates:
    """Final candidates with their weights; equal weights if the diagnosis gave none."""
    if not result.group:
        return ((NONE, 1.0),)
    weights = result.probabilities or (0.0,) * len(result.group)
    total = sum(weights)
    if not total > 0.0:
        weights, total = (1.0,) * len(result.group), float(len(result.group))
    return tuple(
        (frozenset((fault,)), weight / total)
        for fault, weight in zip(result.group, weights, strict=True)
    )


def truth_of(result: RunResult) -> frozenset[str]:
    """The true faults, as a set."""
    return frozenset((result.truth,)) if result.faulty else NONE


def classification_errors(diagnosis: Candidates, truth: frozenset[str]) -> float:
    """Weighted size of the difference between diagnosis and truth."""
    return sum(weight * len(faults ^ truth) for faults, weight in diagnosis)


def utility(diagnosis: Candidates, truth: frozenset[str], components: int) -> float:
    """1 for the exact answer; less for missed and for wrongly blamed faults."""
    return sum(weight * _utility(faults, truth, components) for faults, weight in diagnosis)


def _utility(said: frozenset[str], truth: frozenset[str], f: int) -> float:
    missed, blamed = len(truth - said), len(said - truth)
    healthy, faulty = f - len(said), len(said)
    return (
        1.0
        - missed * (healthy + 1) / (f * (missed + 1))
        - blamed * (faulty + 1) / (f * (blamed + 1))
    )


@cache
def components(stand: str = "") -> Mapping[str, str]:
    """Component of every fault of a stand's catalogue; empty where the stand is gone."""
    from flea_diag.configuration.description import faults_of
    from flea_diag.configuration.stand import load_stand

    try:
        files = load_stand(stand)
        rows = faults_of(files.actuator, files.faults)
    except InputError:
        return {}
    return {name: f"{row.component} {row.channel}".strip() for name, row in rows.items()}


def component_of(fault: str, stand: str = "") -> str:
    """Component of a fault; the fault itself if the stand's catalogue does not list it."""
    return components(stand).get(fault, fault)


def component_right(result: RunResult) -> bool:
    """Whether the final group names the right component only, in any mode."""
    if not result.faulty:
        return result.right
    blamed = {component_of(fault, result.stand) for fault in result.group}
    sound = result.detected and not result.false_alarms and not result.failure
    return sound and blamed == {component_of(result.truth, result.stand)}


def missed(result: RunResult) -> bool:
    """False negative: a faulty run that is not detected after its onset.

    Faults that the verdict lists as not observable are counted separately.
    """
    return result.faulty and bool(result.expected) and not (result.detected or result.unseen)


def component_utility(result: RunResult) -> float:
    """``utility`` where all positions and modes of a sensor are one component."""

    def of(faults: frozenset[str]) -> frozenset[str]:
        return frozenset(component_of(fault, result.stand) for fault in faults)

    said = tuple((of(faults), weight) for faults, weight in candidates(result))
    count = len(set(components(result.stand).values()))
    return utility(said, of(truth_of(result)), max(count, 1))


def once(results: Sequence[RunResult]) -> tuple[RunResult, ...]:
    """Each run once: its first fold that is not right, else its first fold."""
    found: dict[tuple[str, str], RunResult] = {}
    for result in results:
        key = result.id, result.configuration
        if key not in found or (found[key].right and not result.right):
            found[key] = result
    return tuple(found.values())


def share(right: int, count: int) -> dict[str, Any]:
    """A share with its interval, in per cent."""
    low, high = wilson(right, count)
    return {
        "right": right,
        "count": count,
        "percent": _rounded(100.0 * right / count) if count else None,
        "low_percent": _rounded(100.0 * low),
        "high_percent": _rounded(100.0 * high),
    }


def right_share(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Share of right answers among runs whose fault is observable."""
    counted = [result for result in runs if not result.unseen]
    return share(sum(result.right for result in counted), len(counted))


def scores(results: Sequence[RunResult]) -> dict[str, Any]:
    """All metrics of runs of one kind, each run once; times as means, medians and worst."""
    every = once(results)
    runs = [result for result in every if not result.failure]
    return {
        "runs": len(runs),
        "failed": len(every) - len(runs),
        "right": right_share(every),
        **_shares(runs),
        **_times(runs),
        **_diagnoses(runs),
        **_costs(runs),
        "false_alarms_per_hour": false_alarm_rate(runs),
    }


def _shares(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Shares of runs; faults listed as not observable count as ``unseen`` only."""
    sought = [result for result in runs if result.faulty and result.expected]
    expected = [result for result in sought if not result.unseen]
    unseen = len(sought) - len(expected)
    found = sum(1 for result in expected if component_right(result))
    false = sum(1 for result in runs if result.false_alarms)
    absent = sum(1 for result in runs if missed(result))
    wrong = sum(1 for result in runs if result.false_alarms or missed(result))
    return {
        "unseen": share(unseen, len(sought)),
        "component_right": share(found, len(expected)),
        "false_positives": share(false, len(runs)),
        "false_negatives": share(absent, len(expected)),
        "detection_accuracy": share(len(runs) - unseen - wrong, len(runs) - unseen),
    }


def _times(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Times of the runs that were detected."""
    detected = [result for result in runs if result.faulty and result.detected]
    return {
        "detection_time_s": _spread([result.detection_time_s for result in detected]),
        "detection_motion_s": _spread([result.detection_motion_s for result in detected]),
        "isolation_time_s": _spread([result.isolation_time_s for result in detected]),
        "group_size": _mean([float(len(result.group)) for result in detected]),
    }


def _diagnoses(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Metrics that compare the weighted candidates with the truth."""
    errors = [classification_errors(candidates(run), truth_of(run)) for run in runs]
    utilities = [component_utility(run) for run in runs]
    return {"classification_errors": _rounded(sum(errors)), "utility": _mean(utilities)}


def _costs(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Features, processor time and memory."""
    recorded_s, cpu_s = sum(r.duration_s for r in runs), sum(r.cpu_s for r in runs)
    return {
        "features_computed": _mean([float(len(r.features_computed)) for r in runs]),
        "features_skipped": _mean([float(r.features_skipped) for r in runs]),
        "cpu_s": _spread([r.cpu_s for r in runs]),
        "times_real_time": _rounded(recorded_s / max(cpu_s, 1e-9)),
        "peak_memory_mb": _mean([r.peak_memory_bytes / 1e6 for r in runs]),
    }


def false_alarm_rate(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Episodes per hour of healthy running, with an exact interval."""
    events = sum(result.false_alarms for result in runs)
    hours = sum(result.nominal_s for result in runs) / 3600.0
    low, high = rate_interval(events, hours)
    return {
        "alarms": events,
        "hours": _rounded(hours),
        "per_hour": _rounded(events / hours) if hours else None,
        "low": _rounded(low),
        "high": _rounded(high) if hours else None,
    }


def confusion(results: Sequence[RunResult]) -> dict[str, dict[str, int]]:
    """Truth -> first-ranked fault of the final group (or the outcome) -> runs."""
    found: dict[str, Counter[str]] = {}
    for result in once(results):
        if result.failure:
            continue
        said = result.group[0] if result.group else result.outcome.lower()
        found.setdefault(result.truth, Counter())[said] += 1
    return {truth: dict(said.most_common()) for truth, said in sorted(found.items())}


def _spread(values: Sequence[float | None]) -> dict[str, Any] | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    return {
        "mean": _rounded(statistics.fmean(known)),
        "median": _rounded(statistics.median(known)),
        "worst": _rounded(max(known)),
    }


def _mean(values: Sequence[float]) -> float | None:
    return _rounded(statistics.fmean(values)) if values else None


def _rounded(value: float) -> float:
    """Four significant digits: more would claim more than was measured."""
    return float(f"{value:.4g}")
