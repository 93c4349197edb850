"""The metrics of the diagnosis competitions (DXC), for single faults.

A diagnosis is a set of candidates with weights that sum to one; a candidate is a set of faults,
here of one, or of none where nothing was said. Sources: T. Kurtoglu et al., First International
Diagnosis Competition, DX-09; A. Feldman et al., Int. J. PHM 1 (2010).
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from flea_diag.tools.campaign.run_result import RunResult
from flea_diag.tools.interval import rate_interval, wilson

NONE = frozenset[str]()
Candidates = Sequence[tuple[frozenset[str], float]]


def candidates(result: RunResult) -> Candidates:
    """Final candidates with their weights; equal ones where the diagnosis gave none."""
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
    """What was wrong, as a set."""
    return frozenset((result.truth,)) if result.faulty else NONE


def classification_errors(diagnosis: Candidates, truth: frozenset[str]) -> float:
    """Weighted size of the difference between what was said and what was so."""
    return sum(weight * len(faults ^ truth) for faults, weight in diagnosis)


def utility(diagnosis: Candidates, truth: frozenset[str], components: int) -> float:
    """1 for the exact answer; less for what was missed and for what was blamed wrongly."""
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
def components() -> Mapping[str, str]:
    """Component of every fault of the catalogue."""
    from flea_diag.configuration import knowledge, load_calibration

    rows = knowledge(load_calibration("")).faults
    return {name: f"{row.component} {row.channel}".strip() for name, row in rows.items()}


def component_of(fault: str) -> str:
    """Component that a fault belongs to, itself where the catalogue does not know it."""
    return components().get(fault, fault)


def component_right(result: RunResult) -> bool:
    """Whether the final group names the right component alone, in whatever mode."""
    if not result.faulty:
        return result.right
    blamed = {component_of(fault) for fault in result.group}
    sound = result.detected and not result.false_alarms and not result.failure
    return sound and blamed == {component_of(result.truth)}


def missed(result: RunResult) -> bool:
    """False negative: a faulty run that was to be detected, and never was after the onset.

    What the verdict says it cannot show is counted apart.
    """
    return result.faulty and bool(result.expected) and not (result.detected or result.unseen)


def by_component(diagnosis: Candidates) -> Candidates:
    """The same candidates as sets of components."""
    return tuple((frozenset(map(component_of, faults)), weight) for faults, weight in diagnosis)


def once(results: Sequence[RunResult]) -> tuple[RunResult, ...]:
    """Each run once: of its folds the first that is not right, else the first."""
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
    """Share of right answers among runs whose fault the stand can show."""
    counted = [result for result in runs if not result.unseen]
    return share(sum(result.right for result in counted), len(counted))


def scores(results: Sequence[RunResult]) -> dict[str, Any]:
    """All metrics of runs of one kind; each run once, times as medians and means."""
    every = once(results)
    runs = [result for result in every if not result.failure]
    faulty = [result for result in runs if result.faulty]
    sought = [result for result in faulty if result.expected]
    expected = [result for result in sought if not result.unseen]
    unseen = len(sought) - len(expected)
    false = sum(1 for result in runs if result.false_alarms)
    absent = sum(1 for result in runs if missed(result))
    either = sum(1 for result in runs if result.false_alarms or missed(result))
    grouped = [result for result in faulty if result.detected]
    blame = [(candidates(result), truth_of(result)) for result in runs]
    # The single positions and modes of a sensor are one component; all there are, once.
    f = len(set(components().values()))
    return {
        "runs": len(runs),
        "failed": len(every) - len(runs),
        "right": right_share(every),
        "unseen": share(unseen, len(sought)),
        "component_right": share(
            sum(component_right(result) for result in expected), len(expected)
        ),
        "false_positives": share(false, len(runs)),
        "false_negatives": share(absent, len(expected)),
        "detection_accuracy": share(len(runs) - unseen - either, len(runs) - unseen),
        "detection_time_s": _spread([r.detection_time_s for r in grouped]),
        "detection_motion_s": _spread([r.detection_motion_s for r in grouped]),
        "isolation_time_s": _spread([r.isolation_time_s for r in grouped]),
        "classification_errors": _rounded(
            sum(classification_errors(said, truth) for said, truth in blame)
        ),
        "utility": _mean(
            [
                utility(by_component(said), frozenset(map(component_of, truth)), f)
                for said, truth in blame
            ]
        ),
        "group_size": _mean([float(len(r.group)) for r in grouped]),
        "features_computed": _mean([float(len(r.features_computed)) for r in runs]),
        "features_skipped": _mean([float(r.features_skipped) for r in runs]),
        "cpu_s": _spread([r.cpu_s for r in runs]),
        "times_real_time": _rounded(
            sum(r.duration_s for r in runs) / max(sum(r.cpu_s for r in runs), 1e-9)
        ),
        "peak_memory_mb": _mean([r.peak_memory_bytes / 1e6 for r in runs]),
        "false_alarms_per_hour": false_alarm_rate(runs),
    }


def false_alarm_rate(runs: Sequence[RunResult]) -> dict[str, Any]:
    """Episodes while nothing was wrong, for each hour of it, with an exact interval."""
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
