"""Actions of ``flea features``, one function each."""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.files import given_file
from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import Stand
from flea_diag.core.choice.diagnosis_tree import build, render
from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_learning import (
    NOMINAL,
    Ends,
    FeatureStatistics,
    Sample,
    Score,
    learn,
    nearest,
    rank,
    select,
)
from flea_diag.core.vibration.features import FEATURES, FeatureId
from flea_diag.core.vibration.level_learning import LEAST_RUNS, learn_levels
from flea_diag.core.vibration.nominal_range import NominalRange
from flea_diag.core.vibration.vibration_monitor import BLOCKS, RAISED, SECTIONS
from flea_diag.errors import CalibrationError, ConfigurationError, shown
from flea_diag.tools.extra import require
from flea_diag.tools.features import bearing, bench
from flea_diag.tools.features.judge import judge, pair_report, report
from flea_diag.tools.features.runs import labelled_runs, seeds_of
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.features.stand import SEVERITIES
from flea_diag.tools.features.table_file import Making, table_mapping, write_table
from flea_diag.tools.features.tree_picture import draw_tree
from flea_diag.tools.planned_runs import check_planned
from flea_diag.tools.stand_option import chosen_stand
from flea_diag.tools.terminal import progress, say

KEPT = (
    "accelerometer_1_std",
    "accelerometer_2_std",
    "accelerometer_2_nut_line",
    "accelerometer_1_order_1_amplitude",
    "motor_voltage_speed",
)
"""Features in every table: the two of the founding paper, and those that follow from the physics of
a fault: the ball-pass line of a spall, the once-per-turn vibration of an eccentric rotor, the back
EMF lost with bypassed turns. Strong faults also show in many other features, so a ranking over
all fault sizes would not select these."""

HEARD = ("accelerometer_1_kurtosis", "accelerometer_2_kurtosis")
"""Features of the vibration monitor besides ``std``. They are never requested: tested as requested
features, they misclassified more noisy accelerometers, since they repeat other features."""

POINT_CHANNELS = ("motor_speed_", "load_force_")
"""Channels that define the operating point: a fault of them shifts the nominal ranges, so it has no
row in the table."""

LEFT_OUT = ("mean", "rms", "skewness", "kurtogram_band", "motor_heating", "nut_heating")
"""Features not learned from: offset and polarity of a sensor, name of a band, slopes over 1 s."""


LEVEL_ALARMS_PER_HOUR = 0.1
"""False alarms per hour of healthy operation, of the whole vibration monitor (all axes, in motion
and at rest)."""


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


def _learn(arguments: argparse.Namespace) -> int:
    stand = _stand(arguments)
    runs, source, failed = labelled_runs(arguments)
    samples = [sample for run in runs for sample in run.samples]
    ids = _candidates(samples)
    learned = learn(samples, ids, arguments.false_alarm_rate)
    costs = {feature: FeatureId.parse(feature).feature.cost for feature in ids}
    ranking = rank(learned, costs)
    kept = [feature for feature in KEPT if feature in learned.ranges]
    chosen = select(learned, costs, arguments.most, kept)
    heard = [feature for feature in HEARD if feature in learned.ranges and feature not in chosen]
    answers = select(learned, costs, len(heard), heard)
    making = Making(
        arguments.title,
        f"learned from {source}: {len(runs)} runs, "
        f"{len(samples)} windows of {arguments.window:g} s",
        source,
        _one_rate(runs),
        arguments.window,
        arguments.false_alarm_rate,
        bench.FLEA_SCREW.orders(),
    )
    levels = _levels(runs, arguments.hop)
    mapping = table_mapping(
        learned, chosen, answers, costs, levels, _unaffected(learned, stand), making
    )
    write_table(arguments.output, mapping, _header(arguments, making, learned))
    _print_ranking(ranking, chosen, learned)
    say(f"{arguments.output}: {len(chosen)} features, {len(learned.faults)} faults learned")
    return failed


def _train(arguments: argparse.Namespace) -> int:
    from flea_diag.tools.features.classifier import train, write_classifier

    runs, source, failed = labelled_runs(arguments)
    samples = [sample for run in runs for sample in run.samples]
    network = train(samples, _candidates(samples), source)
    write_classifier(arguments.output, network)
    say(f"{arguments.output}: {len(network.features)} features, {len(network.faults)} classes")
    return failed


def _judge(arguments: argparse.Namespace) -> int:
    table = load_features(given_file(arguments.table))
    group = [name for name in arguments.group.split(",") if name] or list(table.faults)
    _known(group, table.faults, str(arguments.table))
    runs, source, failed = labelled_runs(
        arguments, [f for f in group if f in SEVERITIES], nominal=False
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
    stand = _stand(arguments)
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


def _stand(arguments: argparse.Namespace) -> Stand:
    """The stand of the arguments; a range of seeds is refused with the option that takes it."""
    if ":" in arguments.stand:
        raise ConfigurationError(
            f"features: --stand = {shown(arguments.stand)} is no stand; seeds of simulated runs "
            "are given by --seeds FIRST:LAST"
        )
    return chosen_stand(arguments)


def _known(faults: Iterable[str], known: Iterable[str], what: str) -> None:
    unknown = sorted(set(faults) - set(known))
    if unknown:
        raise ConfigurationError(
            f"{what}: fault {shown(unknown[0])} is unknown: choose of {', '.join(known)}"
        )


ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": _list,
    "bench": _bench,
    "learn": _learn,
    "train": _train,
    "judge": _judge,
    "study": _study,
    "tree": _tree,
    "bearing": _bearing,
}


def _candidates(samples: Sequence[Sample]) -> list[str]:
    """Feature ids to learn from: all in the samples except the excluded ones."""
    ids = dict.fromkeys(feature for sample in samples for feature in sample.values)
    return [feature for feature in ids if FeatureId.parse(feature).feature.name not in LEFT_OUT]


def _unaffected(learned: FeatureStatistics, stand: Stand) -> list[str]:
    """Faults of the catalogue that affect neither an accelerometer nor the operating point."""
    rows = faults_of(stand.actuator, stand.faults)
    return [
        name
        for name, row in rows.items()
        if not row.vibration and name not in learned.counts and not name.startswith(POINT_CHANNELS)
    ]


def _one_rate(runs: Sequence[FeatureRun]) -> float:
    rates = sorted(run.rate_hz for run in runs if run.rate_hz)
    if not rates:
        raise CalibrationError("no run contains vibration: a table needs sensors/vibration")
    if rates[-1] > 1.01 * rates[0]:
        raise CalibrationError(
            f"runs sampled at {rates[0]:.6g} and at {rates[-1]:.6g} Hz: learn one table per rate"
        )
    return float(round(rates[len(rates) // 2]))


def _levels(runs: Sequence[FeatureRun], hop_s: float) -> dict[str, dict[str, NominalRange]]:
    """Nominal ranges of the vibration monitor for each axis, by section of the table.

    The false-alarm rate is divided equally among these ranges.
    """
    healthy = [run for run in runs if run.levels]
    windows = sum(sample.fault == NOMINAL for run in runs for sample in run.samples)
    hours = windows * hop_s / 3600.0 / max(len(healthy), 1)
    axes = {axis for run in healthy for axis in run.levels[0][1]}
    rate = LEVEL_ALARMS_PER_HOUR * hours / max(len(SECTIONS) * len(axes), 1)
    heard = {
        "std": [run.levels for run in healthy],
        "kurtosis": [run.kurtosis for run in healthy],
    }
    found = {
        section: learn_levels(heard[indicator], rate, moving)
        for (indicator, moving), section in SECTIONS.items()
    }
    for section in (name for name, ranges in found.items() if not ranges):
        say(f"{section}: none, fewer than {LEAST_RUNS} healthy runs; vibration monitor disabled")
    return found


def _header(arguments: argparse.Namespace, making: Making, learned: FeatureStatistics) -> list[str]:
    command = f"flea features learn <{len(arguments.bags)} bags>"
    if arguments.seeds:
        command = f"flea features learn --seeds {arguments.seeds} --loads {arguments.loads}"
    counts = ", ".join(f"{fault} {count}" for fault, count in learned.counts.items())
    return [
        f"{making.title}. Made by",
        f"  {command} --duration {arguments.duration:g} --window {arguments.window:g} "
        f"--hop {arguments.hop:g} --false-alarm-rate {arguments.false_alarm_rate:g} "
        f"--most {arguments.most}",
        "Each entry: probability that the feature reads below, inside or above its nominal range",
        "when the fault is there, counted over moving windows (half a count added to each); ++ and",
        "-- lie more than `much` half widths of the range from its middle, 0^ inside the range and",
        "more than `upper` above its middle.",
        f"Windows: {counts}.",
        "Nominal ranges follow the operating point: centre = coefficients . (1, ln(0.1 + w/100),",
        "w/100, ln(0.5 + F/100)) with the rms speed w (rad/s) and load F (N) of the window.",
        "levels, resting_levels, kurtosis: the same for blocks (vibration_level): the standard",
        "deviation in motion and at rest, and the kurtosis in motion, so wide that",
        f"{RAISED} of {BLOCKS} in a row lie beyond {LEVEL_ALARMS_PER_HOUR:g} times an hour of",
        "healthy running, of all of them together.",
    ]


def _print_ranking(
    ranking: Sequence[Score], chosen: Mapping[str, Ends], learned: FeatureStatistics
) -> None:
    """Print every feature with its scores, its measured cost, and its closest feature chosen."""
    spent_s = bench.costs_s(repeats=3)
    head = f"{'':2s}{'feature':40s}{'F':>8s}{'AUC':>7s}{'bit':>6s}{'cost':>6s}{'us':>7s}"
    say(head + "  correlated with")
    for score in ranking:
        mark = "*" if score.feature in chosen else ""
        others = [name for name in chosen if name != score.feature]
        name, correlation = nearest(learned, score.feature, others)
        spent = spent_s[FeatureId.parse(score.feature).feature.name] * 1e6
        say(
            f"{mark:2s}{score.feature:40s}{score.variance_ratio:8.2f}{score.auc:7.3f}"
            f"{score.information_bit:6.2f}{score.cost:6.1f}{spent:7.0f}  {correlation:.2f} {name}"
        )
