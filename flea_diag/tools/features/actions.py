"""Actions of ``flea features``, one function each."""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from flea_diag.configuration.files import given_file
from flea_diag.configuration.knowledge import load_features
from flea_diag.core.choice.diagnosis_tree import build, render
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.vibration.features import FEATURES, FeatureId
from flea_diag.errors import ConfigurationError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.features import bearing, bench
from flea_diag.tools.features.judge import judge, pair_report, report
from flea_diag.tools.features.learning import candidates, learn_table
from flea_diag.tools.features.runs import labelled_runs, seeds_of, stand_of
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.features.stand import SEVERITIES
from flea_diag.tools.features.tree_picture import draw_tree
from flea_diag.tools.planned_runs import check_planned
from flea_diag.tools.terminal import progress, say


def _list(_: argparse.Namespace) -> int:
    say(f"{'feature id':38s}{'unit':9s}{'cost':>6s}  meaning")
    for row in FEATURES.values():
        name = row.scope.value + row.name
        say(f"{name:38s}{row.unit:9s}{row.cost:6.1f}  {row.words}")
    return 0


def _bench(_: argparse.Namespace) -> int:
    costs = bench.costs_s()
    say(f"{'feature':30s}{'us':>9s}{'of std':>9s}   (one accelerometer, 1 s x 3 axes, 20 kHz)")
    for name, cost in costs.items():
        say(f"{name:30s}{cost * 1e6:9.0f}{cost / costs['std']:9.1f}")
    say(f"{'whole library, both, shared':30s}{bench.library_s() * 1e6:9.0f}")
    return 0


def _tree(arguments: argparse.Namespace) -> int:
    table = load_features(given_file(arguments.table))
    faults = arguments.faults or table.faults
    _known(faults, table.faults, str(arguments.table))
    if not 0.0 <= arguments.rarest < 1.0:
        raise ConfigurationError(f"--rarest {arguments.rarest:g} must lie between 0 and 1")
    chooser = FeatureChooser(table, arguments.strategy)
    root = build(dict.fromkeys(faults, 1.0), chooser, rarest=arguments.rarest)
    say(render(root))
    if arguments.draw:
        draw_tree(root, arguments.draw)
    for group in table.inseparable(faults):
        if len(group) > 1:
            say(f"not separable by this table: {', '.join(group)}")
    return 0


def _train(arguments: argparse.Namespace) -> int:
    from flea_diag.tools.features.classifier import train, write_classifier

    orders = stand_of(arguments).kinematics.orders()
    runs, source, failed = labelled_runs(arguments, orders)
    samples = [sample for run in runs for sample in run.samples]
    network = train(samples, candidates(samples), source)
    write_classifier(arguments.output, network)
    say(f"{arguments.output}: {len(network.features)} features, {len(network.faults)} classes")
    return failed


def _judge(arguments: argparse.Namespace) -> int:
    table = load_features(given_file(arguments.table))
    group = [name for name in arguments.group.split(",") if name] or list(table.faults)
    _known(group, table.faults, str(arguments.table))
    runs, source, failed = labelled_runs(
        arguments, table.nominal.orders, [f for f in group if f in SEVERITIES], nominal=False
    )
    say(f"{arguments.table} on {source}, group {{{', '.join(group)}}}")
    say(report(judge(runs, table, group, arguments.strategy, arguments.windows)))
    if arguments.pairs:
        say(pair_report(runs, table, group, arguments.strategy, arguments.windows))
    if arguments.classifier:
        _compare(arguments, runs, group)
    return failed


def _compare(
    arguments: argparse.Namespace, runs: Sequence[FeatureRun], group: Sequence[str]
) -> None:
    """Print the score of the classifier on the same windows, and the cost of its features."""
    from flea_diag.tools.features.classifier import call, call_report, read_classifier

    network = read_classifier(arguments.classifier)
    called = call(runs, network, group, arguments.windows)
    cost = math.fsum(FeatureId.parse(feature).feature.cost for feature in network.features)
    say(f"classifier {arguments.classifier}, {len(network.features)} features, cost {cost:.0f}")
    say(call_report(called))


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
    say(told.study_report(runs))
    if arguments.draw:
        told.draw_study(arguments.draw, runs)
    return 0


def _bearing(arguments: argparse.Namespace) -> int:
    files = [arguments.normal, *arguments.faulty]
    normal, *faulty = (bearing.read_bearing(p, arguments.rate, arguments.rpm) for p in files)
    found = bearing.judge(normal, faulty, arguments.window, arguments.false_alarm_rate)
    say(f"{'feature':40s}{'false':>7s}" + "".join(f"{r.name[-14:]:>16s}" for r in faulty))
    for row in found:
        detected = "".join(f"{share:16.3f}" for share in row.detected.values())
        say(f"{row.feature:40s}{row.false_alarms:7.3f}{detected}")
    for recording in (normal, *faulty):
        names = Counter(bearing.lines(recording))
        say(f"{recording.name}: " + ", ".join(f"{n} x {name}" for name, n in names.items()))
    return 0


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
