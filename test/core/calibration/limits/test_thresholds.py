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

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from support import stands
from support.models import linear_ema as ema
from support.observed import FLEA_TOLERANCE

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.limits.extreme_value import return_level
from flea_diag.core.calibration.limits.thresholds import fit_limits, not_nominal
from flea_diag.core.calibration.nominal_trace import Trace
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_rows import ReadingTerm

FLEA = compiled_relations("actuator.yaml").residuals

SHARE = 0.8 / sum(row.gate != "sensor" for row in FLEA.rows)
"""Of the rate of false alarms, for one residual: single sensors and shifts have the rest."""

RATE_PER_HOUR = 3600.0
ALIKE = "parity_kinematic"
"""A residual in which healthy units do not differ."""


def traces(values: list[np.ndarray], name: str = "motor_temperature", speed: float = 0.04):
    found = []
    for n, column in enumerate(values):
        table = np.full((len(column), len(FLEA.rows)), np.nan)
        table[:, FLEA.place[name]] = column
        moving = np.ones(len(column), dtype=bool)
        found.append(Trace(f"t{n}", FLEA, table, np.full(len(column), speed), moving, moving))
    return found


def white(count: int, length: int, seed: int = 0) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).standard_normal((count, length)))


def limits(found: list[Trace], rate_per_hour: float, period_s: float):
    return fit_limits(found, rate_per_hour, period_s, FLEA_TOLERANCE).limits()


def test_scatter_of_means_of_white_noise_falls_with_the_root_of_the_window():
    (limit,) = limits(traces(white(20, 6000)), 0.1, 0.01)
    assert limit.sigma[0] == pytest.approx(1.0, rel=0.02)
    for window in limit.windows:
        assert window.sigma[0] == pytest.approx(1 / np.sqrt(window.window), rel=0.12)
        assert abs(window.centre[0]) < 0.02
    assert limit.correlation_samples == pytest.approx(1.0, abs=0.25)


def test_coloured_noise_is_seen_in_the_means():
    a = 0.95
    runs = []
    for noise in white(20, 6000, seed=1):
        column = np.zeros(6000)
        for k in range(1, 6000):
            column[k] = a * column[k - 1] + noise[k]
        runs.append(column)
    (limit,) = limits(traces(runs), 0.1, 0.01)
    # AR(1): var(mean of w) -> var / w * (1 + a) / (1 - a) = 39 samples to an independent one.
    assert limit.correlation_samples == pytest.approx(39.0, rel=0.25)


def test_the_limit_is_the_student_quantile_or_guards_the_largest_seen():
    columns = white(20, 6000)
    (loose,) = limits(traces(columns), 1e-12, 0.01)
    pieces = 20 * 6000 * 0.01 / 10.0
    for window in loose.windows:
        alpha = SHARE * 1e-12 * window.window * 0.01 / 3600.0
        assert window.k == pytest.approx(stats.t.isf(alpha / 2, pieces - 1), rel=1e-6)
    (strict,) = limits(traces(columns), 1e9, 0.01)
    for window in strict.windows:
        means = [np.convolve(c, np.full(window.window, 1 / window.window), "valid")
                 for c in columns]  # fmt: skip
        largest = 0.0
        for each, own in enumerate(means):
            others = means[:each] + means[each + 1 :]
            centre = np.mean([m.mean() for m in others])
            sigma = np.mean([np.mean((m - centre) ** 2) for m in others]) ** 0.5
            largest = max(largest, np.abs(own - centre).max() / sigma)
        assert window.k == pytest.approx(1.25 * largest, rel=1e-6)


def test_false_alarms_on_fresh_noise_stay_below_the_stated_rate():
    (limit,) = limits(traces(white(20, 6000)), RATE_PER_HOUR, 0.01)
    fresh = np.random.default_rng(99).standard_normal(200_000)
    episodes = 0
    for window in limit.windows:
        means = np.convolve(fresh, np.full(window.window, 1 / window.window), "valid")
        beyond = np.abs(means) > window.k * window.sigma[0]
        episodes += int(beyond[0]) + int((np.diff(beyond.astype(int)) > 0).sum())
    hours = len(fresh) * 0.01 / 3600.0
    assert episodes / hours <= RATE_PER_HOUR * SHARE


def test_the_tail_of_the_scores_of_a_residual_widens_its_limits():
    columns = white(24, 6000)
    even = fit_limits(traces(columns, ALIKE), 0.1, 0.01, FLEA_TOLERANCE)
    assert [fit.widening for fit in even.tests] == [1.0] * len(even.tests)
    uneven = [(1.0 + 0.12 * n) * column for n, column in enumerate(columns)]
    wide = fit_limits(traces(uneven, ALIKE), 0.1, 0.01, FLEA_TOLERANCE)
    (widening,) = {fit.widening for fit in wide.tests}
    level = return_level(wide.scores, 0.9 * 0.1 / 60.0)  # a minute each, a tenth for sensors
    assert widening == pytest.approx(level)
    assert widening > 1.05
    for fit in wide.tests:
        assert fit.k == widening * max(fit.least_k, 1.25 * fit.maxima.max())
    assert wide.out_of_sample().widening == widening


def test_a_recording_that_the_others_contradict_is_found_and_named():
    columns = white(12, 6000)
    columns[3] = columns[3] + 0.8  # a shift of eight sigmas of the mean of 100
    given, folds = traces(columns, ALIKE), [f"t{n}" for n in range(12)]
    fitted = fit_limits(given, 0.1, 0.01, FLEA_TOLERANCE, folds)
    ((name, reason),) = not_nominal(given, 0.1, 0.01, FLEA_TOLERANCE, folds, {}, fitted).items()
    assert name == "t3"
    assert "times the limit that the other recordings give" in reason
    healthy = traces(white(12, 6000), ALIKE)
    fitted = fit_limits(healthy, 0.1, 0.01, FLEA_TOLERANCE)
    assert not_nominal(healthy, 0.1, 0.01, FLEA_TOLERANCE, folds, {}, fitted) == {}


@pytest.mark.parametrize(("load", "blamed"), [(3.0, []), (0.4, ["t3"])])
def test_a_recording_under_a_load_of_its_own_is_not_judged_by_the_others(load, blamed):
    columns = white(12, 6000)
    columns[3] = columns[3] + 0.8
    draw = np.random.default_rng(4)
    given = [
        replace(trace, loads=draw.uniform(-1.0, 1.0, (6000, 1)) * (n != 3) + load * (n == 3))
        for n, trace in enumerate(traces(columns, ALIKE))
    ]
    folds = [trace.name for trace in given]
    fitted = fit_limits(given, 0.1, 0.01, FLEA_TOLERANCE, folds)
    found = not_nominal(given, 0.1, 0.01, FLEA_TOLERANCE, folds, {}, fitted)
    assert list(found) == blamed


def test_coefficients_have_limits_only_where_readings_are_named():
    draw = np.random.default_rng(8)
    given = []
    for trace in traces(white(6, 3000), "parity_mechanical"):
        signals = draw.standard_normal((3000, 2)) + 4.0
        spread = np.zeros((3000, len(FLEA.spreading), len(UNIT_PARAMETERS)))
        given.append(replace(trace, signals=signals, spread=spread))
    term = ReadingTerm("parity_mechanical", "motor_current", 1, 4.0)
    plain = fit_limits(given, 0.1, 0.01, FLEA_TOLERANCE).shift_limits()
    assert {limit.along for limit in plain} == {""}
    found = fit_limits(given, 0.1, 0.01, FLEA_TOLERANCE, terms=[term]).shift_limits()
    assert found[: len(plain)] == tuple(
        replace(limit, k=new.k) for limit, new in zip(plain, found, strict=False)
    )
    own = [limit for limit in found if limit.along]
    assert [(limit.name, limit.along, limit.window) for limit in own] == [
        ("parity_mechanical", "motor_current", window) for window in (200, 400, 800, 1600)
    ]
    # White noise has the noise of a sample, and of 50 that count as one independent sample.
    assert [limit.sigma for limit in own] == pytest.approx([1.0] * 4, rel=0.05)
    assert all(2.0 * np.sqrt(1.0 / 50.0) < limit.k < 2.0 for limit in own)


def test_regions_with_few_recordings_borrow_from_all():
    slow, fast = (
        traces(white(6, 3000), speed=0.02),
        traces([3.0 * w for w in white(3, 3000, seed=2)], speed=0.08),
    )
    (limit,) = limits(slow + fast, 0.1, 0.01)
    first = limit.windows[0]
    assert first.sigma[0] < first.sigma[2] / 1.2
    assert first.sigma[1] == first.sigma[2]


@pytest.mark.parametrize("columns", [[], white(1, 3000), [np.zeros(3000)] * 4, white(4, 30)])
def test_no_limit_where_nothing_can_be_learned(columns):
    assert limits(traces(columns), 0.1, 0.01) == ()


@pytest.mark.slow
def test_a_stand_gets_limits_for_what_it_can_form_and_for_nothing_else():
    have = {limit.name for limit in stands.calibration().limits}
    assert {"parity_mechanical", "parity_electrical_dn", "motor_temperature"} <= have
    assert not have & {"parity_kinematic", "parity_drive", "parity_speed"}
    whole = {limit.name for limit in stands.calibration(ema.CHANNELS).limits}
    assert {"parity_kinematic", "parity_drive", "parity_speed"} <= whole


def test_bad_stretches_are_found_left_out_and_named():
    from functools import partial

    from flea_diag.configuration.description import compiled_relations
    from flea_diag.core.calibration.calibration import NominalRun
    from flea_diag.core.calibration.identification import identify
    from flea_diag.core.calibration.nominal_trace import stretches, trace

    columns = [dict(each) for each in ema.nominal_runs()]
    voltage = columns[2]["motor_voltage"].copy()
    voltage[800:1000] = -24.0
    columns[2]["motor_voltage"] = voltage
    runs = [NominalRun(f"r{n}", ema.rows(each, ema.STAND)) for n, each in enumerate(columns)]
    found = identify(runs, partial(compiled_relations, "actuator.yaml", ema.STAND), 31, 0.01)
    relations = compiled_relations("actuator.yaml", ema.STAND, False)
    traced = [trace(run, found, relations, 0.01) for run in runs[1:3]]
    assert stretches(traced[0], 0.01) == []
    (stretch,) = stretches(traced[1], 0.01)
    assert (stretch.run, stretch.channel) == ("r2", "motor_voltage")
    assert stretch.start_s == pytest.approx(8.0, abs=0.2)
    assert stretch.end_s == pytest.approx(20.0, abs=0.4)  # trusted again after 10 s
    bad = traced[1].values[900, FLEA.place["parity_electrical"]]
    assert np.isnan(bad)
