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

from functools import lru_cache

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema
from support.stand_runs import diagnosed

from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Record
from flea_sim_driver.scenario.settings import FaultSetting

FIRST_S, SECOND_S = 10.0, 18.0


def wrong(second_s: float, stuck: bool = False) -> list[Record]:
    """A load cell that reads 60 N too much and, from then on, a winding that reads 15 K too hot."""
    columns = ema.noisy(ema.run(seconds=34.0), 60)
    times = 0.01 * np.arange(len(columns["load_force"]))
    load = columns["load_force"] + 60.0 * (times >= FIRST_S)
    hot = columns["motor_temperature"] + 15.0 * (times >= second_s)
    if stuck:
        load = np.where(times >= FIRST_S, 0.0, load)
    scans = stands.scans({**columns, "load_force": load, "motor_temperature": hot})
    return list(stands.replay(stands.pipeline(), [stands.table(), *scans]))


@lru_cache(maxsize=2)
def groups(second_s: float) -> tuple[AmbiguityGroup, ...]:
    return tuple(stands.of(AmbiguityGroup, wrong(second_s)))


@pytest.mark.slow
@pytest.mark.parametrize("second_s", [FIRST_S, SECOND_S])
def test_two_faults_are_told_as_two(second_s: float) -> None:
    last = groups(second_s)[-1]
    assert last.outcome is Outcome.INDISTINGUISHABLE
    assert "two faults" in last.words
    assert "single-fault assumption" not in last.words
    assert {"load_force_bias", "motor_temperature_bias"} <= stands.members(last)
    best = last.pairs[0]
    assert {best.first, best.second} == {"load_force_bias", "motor_temperature_bias"}
    assert sum(member.probability for member in last.members) == pytest.approx(2.0)
    sizes = {member.fault: member.size for member in last.members}
    assert sizes["load_force_bias"] == pytest.approx(60.0, abs=10.0)
    assert sizes["motor_temperature_bias"] == pytest.approx(15.0, abs=2.0)
    assert all(candidate.reason for candidate in (*last.members, *last.dropped))


def test_a_second_fault_is_told_when_it_comes_and_the_first_is_kept() -> None:
    said = groups(SECOND_S)
    alone = [group for group in said if group.outcome is Outcome.ISOLATED]
    assert {name for group in alone for name in stands.members(group)} == {"load_force_bias"}
    first = next(group for group in said if group.pairs)
    assert SECOND_S < (first.stamp_ns - said[0].stamp_ns) / 1e9 < SECOND_S + 10.0
    assert {pair.first for pair in first.pairs} == {"load_force_bias"}
    assert "the second seen from" in first.words
    assert first.episode == alone[0].episode


def test_pairs_pass_the_wire() -> None:
    last = groups(SECOND_S)[-1]
    (again,) = (decode(AmbiguityGroup, encode(last, "stand")),)
    assert again.pairs == last.pairs


def test_an_isolator_that_comes_back_goes_on_with_both() -> None:
    last = groups(SECOND_S)[-1]
    stage = stands.isolator()
    stage.handle(last)
    opened = Detection(last.detected_stamp_ns, 1, True, "parity_mechanical", 9.0, 5.0, "mean")
    said = [*stage.handle(opened), *stage.finish()]
    (group,) = [record for record in said if isinstance(record, AmbiguityGroup)][-1:]
    assert group.pairs == last.pairs


def test_what_a_dead_reading_hides_is_not_observable() -> None:
    last = [g for g in stands.of(AmbiguityGroup, wrong(99.0, stuck=True)) if g.members][-1]
    assert stands.members(last) == {"load_force_dead"}
    hidden = dict(last.not_observable)
    assert hidden["jam"].startswith("hidden by load_force_dead")
    assert "winding_resistance_rise" not in hidden
    assert "jam" not in last.looked_for


@lru_cache(maxsize=2)
def on_the_wing(*faults: FaultSetting) -> AmbiguityGroup:
    """The last verdict on a run of the aileron drive."""
    return diagnosed("wing", 24472, "nominal_trapezoid", *faults)


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_what_a_model_may_be_off_by_hides_no_second_fault() -> None:
    """An encoder that reads a quarter too much, and a drift of the position that is an eighth."""
    first = FaultSetting("motor_speed_scaling", 12.0, 1.273)
    second = FaultSetting("actuator_position_drift", 20.0, 0.000423)
    assert stands.members(on_the_wing(first)) == {"motor_speed_scaling"}
    last = on_the_wing(first, second)
    assert last.outcome is Outcome.INDISTINGUISHABLE
    assert {first.fault, second.fault} <= stands.members(last)


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_a_dead_thermocouple_hides_no_weaker_magnet() -> None:
    """Which the calibration alone would not show, but the level of this run before it does."""
    first = FaultSetting("motor_temperature_dead", 12.0, 0.0)
    second = FaultSetting("magnet_loss", 20.0, 0.11)
    last = diagnosed("ema", 29111, "nominal_loaded", first, second)
    assert {first.fault, second.fault} <= stands.members(last)


@pytest.mark.slow
def test_what_needs_a_reading_that_is_withheld_is_not_observable() -> None:
    last = on_the_wing(FaultSetting("actuator_position_dead", 12.0, 0.0))
    assert stands.members(last) == {"actuator_position_dead"}
    hidden = dict(last.not_observable)
    assert hidden["motor_current_scaling"].startswith("hidden by actuator_position_dead")
    assert "motor_voltage_bias" not in hidden
    assert "motor_current_scaling" not in last.looked_for


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine", "seed", "motion", "first", "second"),
    [
        # A drift of the load cell leaves 2.6 of the scatter of healthy runs, the limit is 7.9.
        (
            "flea",
            25150,
            "nominal_trapezoid",
            FaultSetting("motor_current_scaling", 12.0, 1.433),
            FaultSetting("load_force_bias", 20.0, 113.6),
        ),
        # Without the reading of the surroundings a motor still has a prediction.
        (
            "flea",
            24410,
            "nominal_pulled",
            FaultSetting("ambient_temperature_dead", 12.0, 0.0),
            FaultSetting("motor_temperature_scaling", 20.0, 1.502),
        ),
        # Over the whole episode neither a rise throughout nor none fits the circuit.
        (
            "flea",
            33430,
            "nominal_loaded",
            FaultSetting("motor_speed_bias", 12.0, -14.85),
            FaultSetting("winding_resistance_rise", 20.0, 0.553),
        ),
        # Units differ by more than this lost motion: what the unit was before it tells it, for with
        # an error of a reading no other one has come.
        pytest.param(
            "ema",
            37281,
            "nominal_trapezoid",
            FaultSetting("motor_current_scaling", 12.0, 1.2594817785898202),
            FaultSetting("backlash", 12.0, 0.0004739298103310286),
            marks=pytest.mark.in_turn(2),
        ),
        # A winding heats itself by no more than anything has, 0.08 K/s in the recordings.
        pytest.param(
            "ema",
            37241,
            "nominal_pulled",
            FaultSetting("winding_resistance_rise", 12.0, 0.297),
            FaultSetting("motor_temperature_drift", 12.0, 0.888),
            marks=pytest.mark.in_turn(2),
        ),
        # A jump of 10 K beside a drift of 1.2 K/s is no drift of long ago, which was to be seen.
        pytest.param(
            "ema",
            37421,
            "nominal_loaded",
            FaultSetting("motor_temperature_scaling", 12.0, 1.412),
            FaultSetting("motor_temperature_drift", 12.0, 1.203),
            marks=pytest.mark.in_turn(2),
        ),
    ],
)
def test_one_that_fits_within_the_limits_hides_no_second_fault(
    machine: str, seed: int, motion: str, first: FaultSetting, second: FaultSetting
) -> None:
    last = diagnosed(machine, seed, motion, first, second)
    assert last.outcome is Outcome.INDISTINGUISHABLE
    assert {first.fault, second.fault} <= stands.members(last)


@pytest.mark.slow
def test_a_balance_without_values_waits_for_no_motion_both_ways() -> None:
    """A dead encoder leaves the balance of forces without a value from its first second on."""
    first = FaultSetting("load_force_drift", 12.0, 84.9)
    second = FaultSetting("motor_speed_dead", 20.0, 0.0)
    last = diagnosed("ema", 33291, "nominal_pulled", first, second)
    assert {first.fault, second.fault} == stands.members(last)
