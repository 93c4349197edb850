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

"""A place that one recording alone came to raises the limits there, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema
from support.observed import FLEA_COUNTS, FLEA_TOLERANCE

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.calibration.envelope_fit import _conditions, travel_factors, widened
from flea_diag.core.calibration.limits.thresholds import fit_limits
from flea_diag.core.calibration.limits.window_fit import LEAST_IN_REGION
from flea_diag.core.calibration.nominal_trace import Trace

FLEA = compiled_relations("actuator.yaml").residuals
NAME = "parity_mechanical"
COLUMN, LENGTH = FLEA.place[NAME], 3000


def traces(count: int = 8, end_m: float = 0.005, off_n: float = 80.0) -> list[Trace]:
    """White noise of 10 N between 30 and 60 mm; the last comes to an end, and is off there."""
    draw, found = np.random.default_rng(5), []
    for n in range(count):
        position = np.linspace(0.030 + 1e-4 * n, 0.060, LENGTH)
        values = np.full((LENGTH, len(FLEA.rows)), np.nan)
        values[:, COLUMN] = 10.0 * draw.standard_normal(LENGTH)
        if n == count - 1:
            position[1000:1500] = end_m
            values[1000:1500, COLUMN] += off_n
        moving = np.ones(LENGTH, dtype=bool)
        speed = np.full(LENGTH, 0.04)
        found.append(Trace(f"t{n}", FLEA, values, speed, moving, moving, position=position,
                           position_channel="actuator_position"))  # fmt: skip
    return found


def largest(found: list[Trace], window: int, at_end: bool) -> float:
    """Largest |mean| of what lies on one side of the lower edge."""
    flat = np.full(window, 1.0 / window)
    parts = [t.values[:, COLUMN] * ((t.position < 0.030) == at_end) for t in found]
    return max(float(np.abs(np.convolve(part, flat, "valid")).max()) for part in parts)


def test_the_factor_of_an_end_is_its_largest_mean_over_that_of_the_middle():
    found = traces()
    travel = travel_factors(found, FLEA_COUNTS)
    assert travel is not None
    # Five of eight begin at 30.4 mm or below, or come to the end.
    starts = sorted([0.005, *(0.030 + 1e-4 * n for n in range(7))])
    assert travel.edges == pytest.approx((starts[LEAST_IN_REGION - 1], 0.060))
    expected = max(largest(found, w, True) / largest(found, w, False) for w in (50, 100, 400))
    assert travel.factors[NAME] == pytest.approx((expected, 1.0, 1.0), rel=0.05)
    assert expected > 5.0


def test_one_recording_at_an_end_raises_no_limit_elsewhere():
    found, alike = traces(), traces(off_n=0.0)
    travel = travel_factors(found, FLEA_COUNTS)
    (bare,), (told,), (never,) = (
        fit_limits(part, 0.1, 0.01, FLEA_TOLERANCE).limits()
        for part in (found, [widened(trace, travel) for trace in found], alike)
    )
    raw, with_ends, without = (
        max(window.k * window.sigma[0] for window in limit.windows if window.window == 100)
        for limit in (bare, told, never)
    )
    assert with_ends == pytest.approx(without, rel=0.1)
    assert raw > 2.0 * without


def test_no_end_has_a_factor_where_all_came_or_too_few_are_known():
    assert travel_factors(traces(off_n=0.0), FLEA_COUNTS) is None
    assert travel_factors(traces(LEAST_IN_REGION - 1), FLEA_COUNTS) is None
    nowhere = [replace(trace, position_channel="") for trace in traces()]
    assert travel_factors(nowhere, FLEA_COUNTS) is None


def test_the_envelope_knows_temperatures_and_the_longest_rest():
    """Every recording begins at rest and is in motion from then on, but for reversals."""
    ranges = stands.calibration().envelope.ranges
    runs = ema.nominal_runs()
    for name in ("motor_temperature", "nut_temperature"):
        ends = [(columns[name].min(), columns[name].max()) for columns in runs]
        lows, highs = zip(*ends, strict=True)
        assert ranges[name] == pytest.approx((min(lows), max(highs)))
    rest = np.zeros(700, dtype=bool)
    rest[20:50] = rest[100:350] = True
    still = [replace(trace, moving=~rest) for trace in traces()]
    assert _conditions(still, FLEA_COUNTS)["rest_s"] == (0.0, 2.5)
    assert 0.0 < ranges["rest_s"][1] < 2.0
