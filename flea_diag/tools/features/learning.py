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

"""``flea features learn``: a fault feature table from labelled runs, and what is left out of it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import Stand
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
from flea_diag.core.vibration.features import FeatureId, compute
from flea_diag.core.vibration.level_learning import (
    LEAST_RUNS,
    learn_levels,
    observed_rate,
    usable_runs,
)
from flea_diag.core.vibration.nominal_range import LEAST_WINDOWS, NominalRange
from flea_diag.core.vibration.vibration_monitor import BLOCKS, RAISED, SECTIONS
from flea_diag.core.vibration.window import NotComputableError
from flea_diag.errors import CalibrationError
from flea_diag.tools.features import bench
from flea_diag.tools.features.held_out import window_errors
from flea_diag.tools.features.runs import labelled_runs, stand_of
from flea_diag.tools.features.samples import FeatureRun
from flea_diag.tools.features.table_file import Making, table_mapping, write_table
from flea_diag.tools.terminal import tell, warn

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


def learn_table(arguments: argparse.Namespace) -> int:
    """Learn a table and write it; say what is not in it and why."""
    stand = stand_of(arguments)
    orders = stand.kinematics.orders()
    runs, source, failed = labelled_runs(arguments, orders)
    samples = [sample for run in runs for sample in run.samples]
    ids, rate_hz = candidates(samples), _one_rate(runs)
    learned = learn(samples, ids, arguments.false_alarm_rate)
    _say_left_out(ids, learned, samples, rate_hz, orders)
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
        rate_hz,
        arguments.window,
        arguments.false_alarm_rate,
        orders,
    )
    levels = _levels(runs, arguments.hop)
    errors = window_errors(runs, costs, KEPT, arguments.false_alarm_rate, arguments.most)
    mapping = table_mapping(
        learned, chosen, answers, costs, levels, _unaffected(learned, stand), making, errors
    )
    write_table(arguments.output, mapping, _header(arguments, making, learned))
    words = f"{arguments.output}: {len(chosen)} features, {len(learned.faults)} faults learned"
    rows = [{**asdict(score), "chosen": score.feature in chosen} for score in ranking]
    content = {"output": str(arguments.output), "faults": learned.faults, "features": rows}
    tell(arguments.json, content, "\n".join((*_ranking_lines(ranking, chosen, learned), words)))
    return failed


def candidates(samples: Sequence[Sample]) -> list[str]:
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


def _say_left_out(
    ids: Sequence[str],
    learned: FeatureStatistics,
    samples: Sequence[Sample],
    rate_hz: float,
    orders: Mapping[str, float],
) -> None:
    """Name the features without a range, by their reason."""
    window = bench.bench_window(rate_hz, orders=orders)
    nominal = [sample.values for sample in samples if sample.fault == NOMINAL]
    reasons: dict[str, list[str]] = {}
    for feature in (feature for feature in ids if feature not in learned.ranges):
        count = int(np.isfinite([values[feature] for values in nominal]).sum())
        reason = f"{count} nominal windows have a value, {LEAST_WINDOWS} are needed"
        try:
            compute(feature, window)
        except NotComputableError as error:
            reason = str(error)
        reasons.setdefault(reason, []).append(feature)
    for reason, features in reasons.items():
        warn(f"left out: {', '.join(features)}: {reason}")


def _levels(runs: Sequence[FeatureRun], hop_s: float) -> dict[str, dict[str, NominalRange]]:
    """Nominal ranges of the vibration monitor for each axis, by section of the table.

    The false-alarm rate is divided equally among these ranges.
    """
    healthy = [run for run in runs if run.levels]
    windows = sum(sample.fault == NOMINAL for run in runs for sample in run.samples)
    hours = windows * hop_s / 3600.0 / max(len(healthy), 1)
    axes = {axis for run in healthy for axis in run.levels[0][1]}
    ranges_learned = max(len(SECTIONS) * len(axes), 1)
    rate = LEVEL_ALARMS_PER_HOUR * hours / ranges_learned
    heard = {
        "std": [run.levels for run in healthy],
        "kurtosis": [run.kurtosis for run in healthy],
    }
    found = {
        section: learn_levels(heard[indicator], rate, moving)
        for (indicator, moving), section in SECTIONS.items()
    }
    for (indicator, moving), section in SECTIONS.items():
        known = usable_runs(heard[indicator], moving)
        count = min(map(len, known.values()), default=0)
        state = "in motion" if moving else "at rest"
        if count < LEAST_RUNS:
            warn(
                f"{section}: {count} healthy runs with {RAISED} blocks {state}, {LEAST_RUNS} are "
                f"needed: vibration {state} is not judged by its {indicator}"
            )
        elif observed_rate(count) > rate:
            hourly = observed_rate(count) / rate * LEVEL_ALARMS_PER_HOUR
            warn(
                f"{section}: {count} healthy runs show {hourly:.2g} false alarms an hour at best; "
                f"the stated {LEVEL_ALARMS_PER_HOUR:g} is extrapolated, {2.0 / rate:.2g} runs "
                "would show it"
            )
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
        "window_error: share of windows whose features drop the fault that is there for another,",
        "on the half of the runs that was not learned from.",
    ]


def _ranking_lines(
    ranking: Sequence[Score], chosen: Mapping[str, Ends], learned: FeatureStatistics
) -> Iterator[str]:
    """Every feature with its scores, its measured cost, and its closest feature chosen."""
    spent_s = bench.costs_s(repeats=3)
    head = f"{'':2s}{'feature':40s}{'F':>8s}{'AUC':>7s}{'bit':>6s}{'cost':>6s}{'us':>7s}"
    yield head + "  correlated with"
    for score in ranking:
        mark = "*" if score.feature in chosen else ""
        others = [name for name in chosen if name != score.feature]
        name, correlation = nearest(learned, score.feature, others)
        spent = spent_s[FeatureId.parse(score.feature).feature.name] * 1e6
        yield (
            f"{mark:2s}{score.feature:40s}{score.variance_ratio:8.2f}{score.auc:7.3f}"
            f"{score.information_bit:6.2f}{score.cost:6.1f}{spent:7.0f}  {correlation:.2f} {name}"
        )
