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

"""A loose connector of the simulated stand: the winding is open for 0.2 s every 2 s."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support import stands
from support.stand_runs import last_verdict

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.digest import digest
from flea_diag.tools.evaluate.case_run import in_blocks
from flea_diag.wire.blocks import Block, ScanBlock
from flea_diag.wire.messages.codec import decode, encode
from flea_diag.wire.records import AmbiguityGroup, Outcome, Record, Scan, Truth
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.schedule import courses
from flea_sim_driver.stand import SimulatedStand

ONSET_S = 10.0
END = 2**62
"""Beyond all stamps."""


def contact(fault: dict[str, float], duration_s: float) -> Scenario:
    """The winding open as this says."""
    motion = {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.5, "centre_m": 0.045}
    values = {
        "motion": motion,
        "duration_s": duration_s,
        "seed": 16,
        "sensors": {"vibration": False},
        "faults": [{"fault": "winding_open", "onset_s": ONSET_S, **fault}],
    }
    return scenario_from_mapping(values, "contact")


@cache
def sent(on_s: float, off_s: float) -> tuple[Record, ...]:
    """What the stand sends for 24 s; without times the fault stays."""
    times = {"on_s": on_s, "off_s": off_s} if on_s else {}
    records = SimulatedStand(contact(times, 24.0))
    return tuple(record for record in records if not isinstance(record, Truth))


@cache
def told(on_s: float, off_s: float) -> tuple[Record | Block, ...]:
    """What is said of it, in blocks."""
    pipeline, said = make_pipeline(load_stand()), []
    for record in in_blocks(sent(on_s, off_s)):
        by_block = isinstance(record, ScanBlock)
        said += pipeline.handle_block(record) if by_block else pipeline.handle(record)
    return tuple(said) + pipeline.finish()


def verdict(said: tuple[Record | Block, ...]) -> AmbiguityGroup:
    return [record for record in said if isinstance(record, AmbiguityGroup)][-1]


@pytest.mark.slow
def test_an_opening_of_a_fifth_of_a_second_comes_and_goes() -> None:
    group = verdict(told(0.2, 1.8))
    (recurrence,) = group.comes_and_goes
    assert "winding_open" in {member.fault for member in group.members}
    assert len(group.members) <= 4
    assert recurrence.count == pytest.approx(7, abs=1)
    assert "comes and goes" in group.words
    assert decode(AmbiguityGroup, encode(group, "flea")).comes_and_goes == (recurrence,)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("on_s", "off_s", "count"),
    [
        pytest.param(0.2, 0.5, 20, id="which looks like another unit after a while"),
        pytest.param(0.3, 0.25, 25, id="whose gaps are shorter than the smoothing"),
    ],
)
def test_gaps_may_be_short(on_s: float, off_s: float, count: int) -> None:
    """The deviation hardly ever ends; where the motor turns round, openings are not seen."""
    group = verdict(told(on_s, off_s))
    (recurrence,) = group.comes_and_goes
    assert "winding_open" in {member.fault for member in group.members}
    assert 0.5 * count <= recurrence.count <= count


@pytest.mark.slow
def test_one_that_stays_does_not() -> None:
    group = verdict(told(0.0, 0.0))
    assert "winding_open" in {member.fault for member in group.members}
    assert group.comes_and_goes == ()


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_scan_by_scan_it_is_the_same_to_the_last_bit() -> None:
    """While the winding opens for the first four times; before and after in blocks."""
    pipeline, said = make_pipeline(load_stand()), []
    start_ns = sent(0.2, 1.8)[0].stamp_ns
    begin_ns, end_ns = (start_ns + round((ONSET_S + s) * 1e9) for s in (-0.5, 7.5))
    before, during, after = (
        [r for r in sent(0.2, 1.8) if low <= r.stamp_ns - begin_ns < high]
        for low, high in ((-END, 0), (0, end_ns - begin_ns), (end_ns - begin_ns, END))
    )
    said += stands.said_in_blocks(pipeline, before)
    said += [caused for record in during for caused in pipeline.handle(record)]
    said += stands.said_in_blocks(pipeline, after)
    alone = tuple(said) + pipeline.finish()
    groups = [record for record in told(0.2, 1.8) if not isinstance(record, Block)]
    assert digest(alone) == digest(groups)
    assert verdict(alone).comes_and_goes == verdict(tuple(groups)).comes_and_goes


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_a_healthy_machine_that_pushes_against_its_stop_has_nothing_that_comes_and_goes() -> None:
    """There the motor holds a current as in no healthy recording, once a stroke."""
    motion = {"kind": "sine", "amplitude_m": 0.03, "frequency_hz": 0.2, "centre_m": 0.0168}
    values = {
        "machine": "ema",
        "motion": motion,
        "load": {"constant_n": -4145.0},
        "travel": {"stopped": "nut", "overtravel_m": 0.015, "high_m": 0.15},
        "duration_s": 32.0,
        "seed": 3,
        "sensors": {"vibration": False},
    }
    records = SimulatedStand(scenario_from_mapping(values, "stop"))
    pipeline = make_pipeline(load_stand("ema"))
    sent = [record for record in records if not isinstance(record, Truth)]
    said = stands.said_in_blocks(pipeline, sent)
    group = verdict((*said, *pipeline.finish()))
    assert (group.outcome, group.comes_and_goes) == (Outcome.NOMINAL, ())
    scans = [record for record in sent if isinstance(record, Scan)]
    places = [scan.values[scan.channels.index("actuator_position")] for scan in scans]
    assert sum(place <= 0.0 for place in places) > 200


@pytest.mark.slow
def test_a_bridge_that_differs_is_no_supply_that_comes_and_goes() -> None:
    """Its voltage is off wherever the motor drives, which a unit explains in more windows."""
    scenario = {
        "duration_s": 40.0,
        "seed": 1977036903,
        "unit_seed": 372,
        "ambient_degc": 21.1,
        "warm_degc": 9.7,
        "motion": {"kind": "trapezoid", "amplitude_m": 0.0146, "frequency_hz": 0.082,
                   "centre_m": 0.0422, "rise_s": 1.2},
        "load": {"constant_n": 89.0},
    }  # fmt: skip
    assert last_verdict(**scenario).outcome is Outcome.NOMINAL


@pytest.mark.slow
def test_contacts_shorter_than_a_window_are_counted() -> None:
    """At random, so that some follow each other closely."""
    scenario = contact({"onset_s": 8.0, "on_s": 0.12, "off_s": 1.0, "irregular": 1.0}, 30.0)
    (course,) = courses(scenario)
    times_s = np.arange(0.0, 30.0, 0.005).tolist()
    there = [course.size_at(time_s, scenario.run.active_unit) is not None for time_s in times_s]
    came = np.count_nonzero(np.diff(np.array(there, dtype=int)) > 0)
    said = stands.said_in_blocks(make_pipeline(load_stand()), SimulatedStand(scenario))
    (recurrence,) = verdict(tuple(said)).comes_and_goes
    assert recurrence.count == pytest.approx(came, abs=1)
    assert recurrence.count <= came <= recurrence.most
