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

"""Shift tests on a stream of residuals: units, offsets learned, and a voltage that stands alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.observed import FLEA_COUNTS

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.detection import detection
from flea_diag.core.detection.mean_shift import MeanShiftLimit
from flea_diag.core.detection.mean_shift_test import MeanShiftTest
from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.residuals.parameters import UNIT_PARAMETERS
from flea_diag.core.residuals.residual_rows import ReadingTerm
from flea_diag.core.residuals.thermal import CORRECTION_S

FLEA = compiled_relations("actuator.yaml").residuals

UNITS = len(UNIT_PARAMETERS)
ELECTRICAL = FLEA.place["parity_electrical"]
MECHANICAL = FLEA.place["parity_mechanical"]
PLACE = FLEA.spreading.index(ELECTRICAL)
LIMIT = MeanShiftLimit("parity_electrical", 200, 0.2, 5.0)
VOLTAGE = UNIT_PARAMETERS.index("voltage_offset_v")
CURRENT = ReadingTerm("parity_mechanical", "motor_current", 1, 0.5, (0,))
ALONG = MeanShiftLimit("parity_mechanical", 200, 1.0, 5.0, "motor_current")


def rows(volts: np.ndarray, spread: np.ndarray | None = None) -> ResidualRows:
    values = np.zeros((len(volts), len(FLEA.rows)))
    values[:, ELECTRICAL] = volts
    table = np.zeros((len(volts), len(FLEA.spreading), UNITS))
    if spread is not None:
        table[:, PLACE] = spread
    nothing = np.zeros((len(volts), 2))
    return ResidualRows(values, table, nothing, nothing, np.zeros(len(volts), dtype=bool))


def step(
    test: MeanShiftTest, made: ResidualRows, alone: bool = False, force: float = math.nan
) -> detection.TestResults:
    """``force``: what the mechanical relation's own test says, in sigmas; its limit is 6."""
    results = detection.TestResults(len(FLEA.rows), len(made))
    results.z[:, MECHANICAL], results.k[:, MECHANICAL] = force, 6.0
    test.step(made, results, np.full(len(made), alone))
    return results


def test_a_step_at_rest_deviates_with_the_shift_as_its_statistic():
    results = step(
        MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS),
        rows(np.repeat([3.0, 4.5], [800, 300])),
    )
    deviating = results.deviating()
    assert not deviating[:800].any()
    assert set(np.flatnonzero(deviating.any(axis=0))) == {ELECTRICAL}
    assert results.z[-101, ELECTRICAL] == pytest.approx(1.5 / 0.2)
    assert results.shift[-101, ELECTRICAL] == pytest.approx(1.5)
    assert np.isnan(results.shift[~deviating]).all()


def test_what_a_healthy_unit_may_differ_by_widens_the_limit():
    moved = np.zeros((1100, UNITS))
    moved[800:, 0] = 1.0
    volts = np.repeat([3.0, 4.5], [800, 300])
    results = step(
        MeanShiftTest(FLEA, [LIMIT], [1.0] + [0.0] * (UNITS - 1), counts=FLEA_COUNTS),
        rows(volts, moved),
    )
    assert not results.deviating().any()


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize(
    ("volts", "leverage", "loads", "seen"),
    [
        # 1.5 V in sigmas of 0.2 V, limit 5, where recordings differ by 0.8 V.
        (1.5, (0.0, 0.0), (0.0, 0.0), 1.5 / 0.2),
        # Another load, the same load elsewhere, and a shift that another load does not explain.
        (1.5, (0.0, 0.0), (-0.6, 0.2), None),
        (1.5, (0.0, 0.0), (0.9, 0.9), 1.5 / 0.2),
        (8.0, (0.0, 0.0), (-0.6, 0.2), 8.0 / math.hypot(0.2, 0.8 * 0.8)),
        # Beyond the calibration, now or before.
        (1.5, (0.0, 3.0), (0.0, 0.0), None),
        (1.5, (3.0, 0.0), (0.0, 0.0), None),
        (9.0, (2.0, 1.0), (0.0, 0.0), 9.0 / math.sqrt(0.2**2 + 3.0 * 0.8**2)),
    ],
)
def test_levels_at_two_places_differ_by_what_recordings_do(volts, leverage, loads, seen, backend):
    if backend == "numba":
        pytest.importorskip("numba")
    between = {"parity_electrical": 0.8**2}
    test = MeanShiftTest(
        FLEA,
        [LIMIT],
        [0.0] * UNITS,
        backend,
        counts=FLEA_COUNTS,
        between=between,
        metric=np.array([[0.01]]),
    )
    found = detection.TestResults(len(FLEA.rows), 1000)
    beyond = np.repeat(leverage, [800, 200])[:, None] * np.ones(len(FLEA.rows))
    load = 100.0 * np.repeat(loads, [800, 200])[:, None]
    test.step(rows(np.repeat([3.0, 3.0 + volts], [800, 200])), found, None, beyond, load)
    assert bool(found.deviating()[-1].any()) is (seen is not None)
    if seen is not None:
        assert found.z[-1, ELECTRICAL] == pytest.approx(seen)


def test_an_offset_of_the_unit_is_no_shift_once_the_run_leaves_the_calibration():
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    found = detection.TestResults(len(FLEA.rows), 1100)
    leverage = np.repeat([0.0, 8.0], [800, 300])[:, None] * np.ones(len(FLEA.rows))
    test.step(rows(np.full(1100, 30.0)), found, None, leverage)
    assert not found.deviating().any()


def test_an_offset_that_is_learned_is_no_shift():
    spread = np.zeros((600, UNITS))
    spread[:, VOLTAGE] = -1.0
    change = [0.0] * UNITS
    change[VOLTAGE] = 2.0
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.full(600, 3.0), spread))
    test.adopt(change)
    assert not step(test, rows(np.full(600, 1.0), spread)).deviating().any()


@pytest.mark.parametrize("alone", [True, False])
def test_the_zero_of_a_voltage_alone_says_nothing(alone):
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.zeros(800)), alone)
    found = step(test, rows(np.full(300, 2.0)), alone).deviating()
    assert bool(found.any()) is not alone


def test_in_an_open_episode_the_level_before_it_counts_and_not_what_follows():
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.repeat([0.0, 2.0], [800, 200])))
    test.turn(opened=True)
    later = step(test, rows(np.full(3000, 2.0)))
    assert later.deviating()[-1, ELECTRICAL]
    test.turn(opened=False)
    assert not step(test, rows(np.full(1000, 2.0)), alone=False).deviating().any()


@pytest.mark.parametrize(
    ("volts", "force", "called"),
    # 0.8 V are 4 sigmas of a limit of 5: with 3.1 sigmas of the force 5.06 together.
    [
        (0.8, -3.1, True),
        (-0.8, 3.1, True),
        (0.8, 3.1, False),
        (0.8, -2.9, False),
        (9.0, -1.9, False),
    ],
)
def test_a_voltage_alone_is_heard_where_the_force_says_the_same_of_the_current(
    volts, force, called
):
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.zeros(800)), alone=True, force=force)
    found = step(test, rows(np.full(200, volts)), alone=True, force=force)
    expected = {ELECTRICAL, MECHANICAL} if called else set()
    assert set(np.flatnonzero(found.deviating()[-1])) == expected
    if called:
        assert abs(found.z[-1, ELECTRICAL]) == pytest.approx(math.hypot(volts / 0.2, force))
        assert found.symbol(ELECTRICAL) != found.symbol(MECHANICAL)
        # The episode that it opens goes on while the level is another one.
        test.turn(opened=True)
        later = step(test, rows(np.full(3000, 2.0)), alone=True, force=0.0)
        assert later.deviating()[-1, ELECTRICAL]
        assert not later.deviating()[-1, MECHANICAL]


@pytest.mark.parametrize("alone", [True, False])
def test_in_an_episode_that_something_else_opened_a_shift_says_nothing(alone):
    """A jam may come with another unit, whose winding has another resistance."""
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.zeros(800)), alone)
    test.turn(opened=True)
    found = step(test, rows(np.full(300, 2.0)), alone, force=-9.0)
    assert set(np.flatnonzero(found.deviating()[-1])) == {MECHANICAL}


def test_in_an_episode_of_a_reading_that_errs_a_shift_goes_on_to_speak():
    """No other unit comes with a dead thermocouple."""
    test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, counts=FLEA_COUNTS)
    step(test, rows(np.zeros(1000)), alone=False)
    test.turn(opened=True, same_unit=True)
    found = step(test, rows(np.full(300, 2.0)), alone=False)
    assert found.deviating()[-1, ELECTRICAL]


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_what_a_more_exact_value_moves_is_no_shift(backend):
    """A value of this run: its residual is another from then on, the unit is not."""
    if backend == "numba":
        pytest.importorskip("numba")
    for moved, is_shift in ((2.0, False), (0.0, True)):
        test = MeanShiftTest(FLEA, [LIMIT], [0.0] * UNITS, backend, counts=FLEA_COUNTS)
        step(test, rows(np.zeros(1000)), alone=False)
        later = rows(np.full(300, 2.0))
        later.moved = np.full_like(later.values, moved)
        assert step(test, later, alone=False).deviating()[-1, ELECTRICAL] == is_shift


def alternating(count: int, share: float, mean: float = 0.0) -> ResidualRows:
    """Forces in proportion to a current that changes its sign twice a second."""
    made = rows(np.zeros(count))
    made.moving[:] = True
    current = mean + 2.0 * np.sin(np.arange(count) * (2.0 * np.pi / 50.0))
    made.signals[:, CURRENT.signal] = current + CURRENT.zero
    made.values[:, MECHANICAL] = share * 100.0 * current
    return made


@pytest.mark.parametrize("mean", [0.3, -0.3])
def test_a_scaled_current_shows_in_the_coefficient_for_as_long_as_it_is(mean):
    means = MeanShiftLimit("parity_mechanical", 200, 1.0, 50.0)
    test = MeanShiftTest(FLEA, [ALONG, means], [0.0] * UNITS, counts=FLEA_COUNTS, terms=[CURRENT])
    assert not step(test, alternating(1000, 0.0)).deviating().any()
    found = step(test, alternating(200, 0.1, mean))
    assert set(np.flatnonzero(found.deviating()[-1])) == {MECHANICAL}
    size = 10.0 * math.sqrt(2.0 + mean**2)  # root mean square of the force
    assert found.z[-1, MECHANICAL] == pytest.approx(np.sign(mean) * size * math.sqrt(200 / 50))
    assert found.shift[-1, MECHANICAL] == pytest.approx(np.sign(mean) * size)
    assert {column: along for column, (along, _) in found.along.items()} == {
        MECHANICAL: "motor_current"
    }
    test.turn(opened=True)
    later = step(test, alternating(3000, 0.1, -mean))
    assert later.deviating()[-1, MECHANICAL]


@pytest.mark.parametrize("between", [0.0, 2.0**2])
def test_what_a_relation_neglects_of_a_load_is_no_shift_of_a_coefficient(between):
    test = MeanShiftTest(
        FLEA,
        [replace(ALONG, sigma=0.05)],
        [0.0] * UNITS,
        counts=FLEA_COUNTS,
        terms=[CURRENT],
        between={"parity_mechanical": between},
        metric=np.array([[0.01]]),
    )
    load = np.repeat([0.0, 100.0], [800, 200])
    made = rows(np.zeros(1000))
    made.moving[:] = True
    made.signals[:, CURRENT.signal] = 0.02 * load + CURRENT.zero
    made.values[:, MECHANICAL] = 0.01 * load
    found = detection.TestResults(len(FLEA.rows), 1000)
    test.step(made, found, None, None, load[:, None])
    assert bool(found.deviating().any()) is (between == 0.0)


def test_the_coefficient_on_a_voltage_alone_says_nothing():
    volts = ReadingTerm("parity_electrical", "motor_voltage", 0, 0.0)
    limit = MeanShiftLimit("parity_electrical", 200, 0.1, 5.0, "motor_voltage")
    for alone in (True, False):
        test = MeanShiftTest(FLEA, [limit], [0.0] * UNITS, counts=FLEA_COUNTS, terms=[volts])
        made = rows(np.zeros(1000))
        made.moving[:] = True
        made.signals[:, 0] = np.tile([9.0, -9.0], 500)
        made.values[800:, ELECTRICAL] = 0.2 * made.signals[800:, 0]
        assert step(test, made, alone, force=-9.0).deviating()[-1, ELECTRICAL] is np.bool_(
            not alone
        )


@pytest.mark.parametrize(
    ("moves", "largest", "seen"), [(True, 9.5, True), (False, 9.5, False), (True, 8.0, False)]
)
def test_a_coefficient_is_tested_in_motion_and_where_its_reading_has_been(moves, largest, seen):
    amps = ReadingTerm("parity_mechanical", "motor_current", 0, 0.0)
    limit = MeanShiftLimit("parity_mechanical", 200, 0.1, 5.0, "motor_current")
    test = MeanShiftTest(
        FLEA,
        [limit],
        [0.0] * UNITS,
        counts=FLEA_COUNTS,
        terms=[amps],
        ranges={"motor_current": (-largest, largest)},
    )
    made = rows(np.zeros(1000))
    made.moving[:] = moves
    made.signals[:, 0] = np.tile([9.0, -9.0], 500)
    made.values[800:, MECHANICAL] = 0.2 * made.signals[800:, 0]
    found = detection.TestResults(len(FLEA.rows), 1000)
    test.step(made, found, None)
    assert bool(found.deviating()[-1, MECHANICAL]) is seen


@pytest.mark.parametrize("known", [True, False])
def test_a_parameter_that_follows_the_heat_shifts_no_coefficient(known):
    """A winding that warms ahead of its housing is no resistance that has risen."""
    seconds = np.arange(4000) * FLEA_COUNTS.period_s
    amps = ReadingTerm("parity_mechanical", "motor_current", 0, 0.0, (0,), ((0, 0), (0, 1)))
    limit = MeanShiftLimit("parity_mechanical", 1600, 0.1, 5.0, "motor_current")
    test = MeanShiftTest(FLEA, [limit], [1.0] * UNITS, counts=FLEA_COUNTS, terms=[amps])
    made = rows(np.zeros(4000))
    made.moving[:] = True
    made.signals[:, 0] = np.tile([9.0, -9.0], 2000)
    made.spread[:, FLEA.spreading.index(MECHANICAL), 0] = made.signals[:, 0]
    # Behind the supply by twice the time of the mean.
    made.values[:, MECHANICAL] = 0.3 * made.signals[:, 0] * -np.expm1(-seconds / 30.0)
    late = seconds / CORRECTION_S
    heating = np.column_stack((-np.expm1(-late), 1.0 - (1.0 + late) * np.exp(-late)))
    found = detection.TestResults(len(FLEA.rows), 4000)
    test.step(made, found, None, supplied=heating if known else None)
    assert bool(found.deviating().any()) is not known


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 113, 6000])
def test_compiled_gives_the_bits_of_numpy(block):
    """Every shift, over rests, missing values, offsets learned, and an episode."""
    pytest.importorskip("numba")
    draw = np.random.default_rng(5)
    made = ResidualRows(
        draw.standard_normal((6000, len(FLEA.rows))),
        draw.standard_normal((6000, len(FLEA.spreading), UNITS)),
        draw.standard_normal((6000, 2)),
        np.zeros((6000, 2)),
        draw.random(6000) > 0.2,
    )
    made.signals[3100, 1] = np.nan
    made.values[[40, 41, *range(2500, 2560)], ELECTRICAL] = np.nan
    limits = [
        MeanShiftLimit(FLEA.rows[j].name, w, 0.2, 0.5) for j in FLEA.spreading for w in (200, 400)
    ]
    limits.append(replace(ALONG, sigma=0.2, k=0.4))
    metric = np.array([[0.2, 0.0], [-0.1, 0.7]])
    known = {"counts": FLEA_COUNTS, "terms": [CURRENT], "metric": metric}
    tests = [
        MeanShiftTest(FLEA, limits[1:], [0.1] * UNITS, backend, **known)
        for backend in ("numpy", "numba")
    ]
    leverage, loads = draw.random((6000, len(FLEA.rows))), draw.standard_normal((6000, 2))
    leverage[draw.random(6000) > 0.3] = 0.0
    loads[50, 1] = np.nan
    counted, coefficients = False, 0
    for start in range(0, 6000, block):
        part = slice(start, start + block)
        parts = (made.values, made.spread, made.signals, made.motion, made.moving)
        piece = ResidualRows(*(column[part] for column in parts))
        results = [detection.TestResults(len(FLEA.rows), len(piece)) for _ in tests]
        for test, result in zip(tests, results, strict=True):
            if start >= 4000 > start - block:
                test.adopt([0.3] * UNITS)
                test.turn(opened=True)
            if start >= 5000 > start - block:
                test.turn(opened=False)
            alone = np.zeros(len(piece), dtype=bool)
            test.step(piece, result, alone, leverage[part], loads[part])
        one, other = results
        assert one.table.tobytes() == other.table.tobytes()
        assert one.shift.tobytes() == other.shift.tobytes()
        counted |= bool(np.isfinite(one.shift).any())
        assert one.along.keys() == other.along.keys()
        for (along, scans), (same, others) in zip(
            one.along.values(), other.along.values(), strict=True
        ):
            assert along == same
            assert np.array_equal(scans, others)
        coefficients += len(one.along)
    assert counted
    assert coefficients or block > 1


@pytest.mark.parametrize("opener", [MECHANICAL, ELECTRICAL])
def test_where_forces_alone_opened_an_episode_the_circuit_of_another_unit_says_nothing(opener):
    """The drag may be that of a unit just switched in, whose winding is another, too."""
    test = MeanShiftTest(
        FLEA,
        [LIMIT, MeanShiftLimit("parity_mechanical", 200, 2.0, 5.0)],
        [0.0] * UNITS,
        counts=FLEA_COUNTS,
    )
    made = rows(np.zeros(1000))
    made.moving[:] = True
    made.values[800:, opener] = 40.0
    step(test, made)
    test.turn(opened=True)
    later = rows(np.full(3000, 40.0))
    later.moving[:] = True
    later.values[:, MECHANICAL] = 40.0
    heard = {ELECTRICAL, MECHANICAL} if opener == ELECTRICAL else {MECHANICAL}
    assert set(np.flatnonzero(step(test, later).deviating()[-1])) == heard
