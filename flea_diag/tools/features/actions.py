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

"""Actions of ``flea features``, one function each."""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from flea_diag.configuration.files import given_file
from flea_diag.configuration.knowledge import load_features
from flea_diag.core.choice.diagnosis_tree import build, render
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.vibration.features import FEATURES, FeatureId
from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.features import bearing, bench
from flea_diag.tools.features.judge import judge, judge_pairs, pair_report, report
from flea_diag.tools.features.learning import candidates, learn_table
from flea_diag.tools.features.runs import labelled_runs, seeds_of, stand_of
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.features.stand import SEVERITIES
from flea_diag.tools.features.tree_picture import draw_tree
from flea_diag.tools.planned_runs import check_planned
from flea_diag.tools.terminal import progress, say, tell


def _list(arguments: argparse.Namespace) -> int:
    rows = [
        {"id": row.scope.value + row.name, "unit": row.unit, "cost": row.cost, "meaning": row.words}
        for row in FEATURES.values()
    ]
    lines = [f"{'feature id':38s}{'unit':9s}{'cost':>6s}  meaning"]
    lines += ["{id:38s}{unit:9s}{cost:6.1f}  {meaning}".format(**row) for row in rows]
    tell(arguments.json, rows, "\n".join(lines))
    return 0


def _bench(arguments: argparse.Namespace) -> int:
    costs, library_s = bench.costs_s(), bench.library_s()
    lines = [f"{'feature':30s}{'us':>9s}{'of std':>9s}   (one accelerometer, 1 s x 3 axes, 20 kHz)"]
    lines += [f"{n:30s}{cost * 1e6:9.0f}{cost / costs['std']:9.1f}" for n, cost in costs.items()]
    lines.append(f"{'whole library, both, shared':30s}{library_s * 1e6:9.0f}")
    tell(arguments.json, {"cpu_s": costs, "library_cpu_s": library_s}, "\n".join(lines))
    return 0


def _tree(arguments: argparse.Namespace) -> int:
    table = load_features(given_file(arguments.table))
    faults = arguments.faults or table.faults
    _known(faults, table.faults, str(arguments.table))
    if not 0.0 <= arguments.rarest < 1.0:
        raise ConfigurationError(f"--rarest {arguments.rarest:g} must lie between 0 and 1")
    chooser = FeatureChooser(table, arguments.strategy)
    root = build(dict.fromkeys(faults, 1.0), chooser, rarest=arguments.rarest)
    if arguments.draw:
        draw_tree(root, arguments.draw)
    groups = [group for group in table.inseparable(faults) if len(group) > 1]
    lines = [render(root), *(f"not separable by this table: {', '.join(g)}" for g in groups)]
    tell(arguments.json, {"tree": asdict(root), "not_separable": groups}, "\n".join(lines))
    return 0


def _train(arguments: argparse.Namespace) -> int:
    from flea_diag.tools.features.classifier import train, write_classifier

    orders = stand_of(arguments).kinematics.orders()
    runs, source, failed = labelled_runs(arguments, orders)
    samples = [sample for run in runs for sample in run.samples]
    network = train(samples, candidates(samples), source)
    write_classifier(arguments.output, network)
    content = {"output": str(arguments.output), "features": network.features}
    words = f"{arguments.output}: {len(network.features)} features, {len(network.faults)} classes"
    tell(arguments.json, {**content, "classes": network.faults}, words)
    return failed


def _judge(arguments: argparse.Namespace) -> int:
    table = load_features(given_file(arguments.table))
    group = [name for name in arguments.group.split(",") if name] or list(table.faults)
    _known(group, table.faults, str(arguments.table))
    runs, source, failed = labelled_runs(
        arguments, table.nominal.orders, [f for f in group if f in SEVERITIES], nominal=False
    )
    walks = judge(runs, table, group, arguments.strategy, arguments.windows)
    lines = [f"{arguments.table} on {source}, group {{{', '.join(group)}}}", report(walks)]
    content: dict[str, Any] = {"table": arguments.table, "runs_of": source, "group": group}
    content["walks"] = [asdict(walk) for walk in walks]
    if arguments.pairs:
        pairs = judge_pairs(runs, table, group, arguments.strategy, arguments.windows)
        lines.append(pair_report(pairs))
        content["pairs"] = {" | ".join(p): [asdict(walk) for walk in w] for p, w in pairs.items()}
    if arguments.classifier:
        words, content["classifier"] = _compared(arguments, runs, group)
        lines.append(words)
    tell(arguments.json, content, "\n".join(lines))
    return failed


def _compared(
    arguments: argparse.Namespace, runs: Sequence[FeatureRun], group: Sequence[str]
) -> tuple[str, list[dict[str, Any]]]:
    """Score of the classifier on the same windows, with the cost of its features; its answers."""
    from flea_diag.tools.features.classifier import call, call_report, read_classifier

    network = read_classifier(arguments.classifier)
    called = call(runs, network, group, arguments.windows)
    cost = math.fsum(FeatureId.parse(feature).feature.cost for feature in network.features)
    head = f"classifier {arguments.classifier}, {len(network.features)} features, cost {cost:.0f}"
    return f"{head}\n{call_report(called)}", [asdict(each) for each in called]


def _study(arguments: argparse.Namespace) -> int:
    from flea_diag.tools.features import study
    from flea_diag.tools.features import study_report as told

    faults = tuple(name for name in arguments.faults.split(",") if name)
    _known(faults, SEVERITIES, "study")
    if arguments.draw:
        require("plot", "--draw")
    stand = stand_of(arguments)
    table = given_file(arguments.table) if arguments.table else stand.features
    plan = study.Plan(faults, stand, table, arguments.classifier)
    seeds = seeds_of(arguments.seeds)
    count = len(seeds) * len(faults)
    check_planned(count, "features study", allow_large=arguments.allow_large)
    runs: list[study.Study] = []
    begun_s = time.monotonic()
    for run in study.study(plan, seeds, jobs=arguments.jobs):
        runs.append(run)
        left_min = (time.monotonic() - begun_s) / 60.0 * (count / len(runs) - 1.0)
        said = f"{run.fault} {run.seed}: {', '.join(run.group)}; {left_min:.0f} min left"
        progress(len(runs), count, said)
        if arguments.json:
            told.write_study(arguments.json, runs)  # after each run, against an interruption
    if arguments.json != "-":
        say(told.study_report(runs))
    if arguments.draw:
        told.draw_study(arguments.draw, runs)
    return 0


def _bearing(arguments: argparse.Namespace) -> int:
    files = [arguments.normal, *arguments.faulty]
    normal, *faulty = (bearing.read_bearing(p, arguments.rate, arguments.rpm) for p in files)
    found = bearing.judge(normal, faulty, arguments.window, arguments.false_alarm_rate)
    named = {r.name: Counter(bearing.lines(r)) for r in (normal, *faulty)}
    rows = [
        {"feature": row.feature, "false_alarms": row.false_alarms, "detected": dict(row.detected)}
        for row in found
    ]
    content = {"features": rows, "lines": named}
    tell(arguments.json, content, "\n".join(_bearing_lines(found, [r.name for r in faulty], named)))
    return 0


def _bearing_lines(
    found: Sequence[bearing.Judgement], names: Sequence[str], named: Mapping[str, Counter[str]]
) -> Iterator[str]:
    yield f"{'feature':40s}{'false':>7s}" + "".join(f"{name[-14:]:>16s}" for name in names)
    for row in found:
        detected = "".join(f"{share:16.3f}" for share in row.detected.values())
        yield f"{row.feature:40s}{row.false_alarms:7.3f}{detected}"
    for name, counts in named.items():
        yield f"{name}: " + ", ".join(f"{n} x {line}" for line, n in counts.items())


def _known(faults: Iterable[str], known: Iterable[str], what: str) -> None:
    unknown = sorted(set(faults) - set(known))
    if unknown:
        raise ConfigurationError(
            f"{what}: fault {shown(unknown[0])} is unknown: choose of {', '.join(known)}"
        )


ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": _list,
    "bench": _bench,
    "learn": learn_table,
    "train": _train,
    "judge": _judge,
    "study": _study,
    "tree": _tree,
    "bearing": _bearing,
}
