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

"""Control goes over to another unit that is as warm: quiet, and a fault all the same where one is.

Runs of the simulated stand, on which the law of its calibration was not learned.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from support import stands
from support.stand_runs import last_verdict, scenario

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.core.evidence.change_evidence import ChangeEvidence
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.stages.pipeline import Pipeline
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.wire.records import (
    ANOTHER_UNIT,
    AmbiguityGroup,
    ChannelTable,
    Detection,
    Outcome,
    Record,
    Scan,
)
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow

SWITCH_S = 15.0
MOTION = {"kind": "sine", "amplitude_m": 0.0218, "frequency_hz": 0.5, "centre_m": 0.045}
OF_WING = {"kind": "sine", "amplitude_m": 0.012, "frequency_hz": 0.4, "centre_m": 0.04}


@cache
def recorded(seed: int, **more: Any) -> tuple[Record, ...]:
    """Half a minute; ``more``: a fault and its size, on the unit of the start or of the switch."""
    values = {"motion": MOTION, "duration_s": 30.0, "seed": seed}
    switch = {"switch": {"at_s": SWITCH_S, "to": "X"}} if more.pop("switched", True) else {}
    unit = {"unit": "X"} if switch else {"onset_s": SWITCH_S}
    faults = {"faults": [{**more, **unit}]} if more else {}
    stand = SimulatedStand(scenario(**values, **switch, **faults))
    return tuple(record for record in stand if isinstance(record, ChannelTable | Scan))


@cache
def of_wing(seed: int, warmer_k: float = 0.0, **fault: Any) -> tuple[Record, ...]:
    """The same on a machine with one thermocouple on its unit."""
    values: dict[str, Any] = {"machine": "wing", "motion": OF_WING, "duration_s": 30.0}
    if warmer_k:
        values["switch"] = {"at_s": SWITCH_S, "to": "X", "warmer_k": warmer_k}
    if fault:
        values["faults"] = [fault | ({"unit": "X"} if warmer_k else {"onset_s": SWITCH_S})]
    stand = SimulatedStand(scenario(**values, seed=seed))
    return tuple(record for record in stand if isinstance(record, ChannelTable | Scan))


def pipeline_of(stand: str) -> Pipeline:
    """With numpy where the relations of a stand are compiled longer than all its runs take."""
    backend = "numpy" if stand in ("wing", "joint") else "auto"
    return make_pipeline(load_stand(stand), observer_backend=backend)


def told(run: tuple[Record, ...], stand: str = "flea") -> tuple[list[Detection], AmbiguityGroup]:
    """Detections of a run, and its last verdict."""
    kept = diagnose(iter(run), pipeline_of(stand)).kept
    groups = [record for record in kept if isinstance(record, AmbiguityGroup)]
    return [record for record in kept if isinstance(record, Detection)], groups[-1]


@pytest.mark.parametrize("seed", [5003, 5014])
def test_another_healthy_unit_is_recognised_by_its_level_alone(seed: int) -> None:
    """Each was called a scaled load cell."""
    run = recorded(seed)
    detections, last = told(run)
    assert [(d.detected, d.test) for d in detections] == [(False, ANOTHER_UNIT)]
    since_s = (detections[0].stamp_ns - run[1].stamp_ns) / 1e9 - SWITCH_S
    assert 0.0 < since_s < 6.0
    assert last.outcome is Outcome.NOMINAL
    assert "unit exchanged" in last.words


def test_what_looked_like_a_fault_at_first_is_closed_as_another_unit() -> None:
    """Its voltage is off by half a volt, which is one error of one reading until it has moved."""
    detections, last = told(recorded(5018))
    assert [(d.detected, d.test == ANOTHER_UNIT) for d in detections] == [
        (True, False),
        (False, True),
    ]
    assert last.outcome is Outcome.NOMINAL


@pytest.mark.parametrize(
    ("fault", "size"),
    [("winding_resistance_rise", 0.4), ("load_force_scaling", 1.25), ("motor_current_bias", 0.4)],
)
def test_a_fault_within_what_units_differ_by_is_no_other_unit(fault: str, size: float) -> None:
    """One parameter has changed, and all others are what they were."""
    detections, last = told(recorded(5003, switched=False, fault=fault, size=size))
    assert [d.detected for d in detections] == [True]
    assert fault in {member.fault for member in last.members}


def test_what_began_before_a_shift_is_no_answer_to_it() -> None:
    """The first strokes of this run look like another unit's; the bias came ten seconds later."""
    motion = {"kind": "trapezoid", "amplitude_m": 0.0161, "frequency_hz": 0.091}
    values = {
        "motion": motion | {"centre_m": 0.0542, "rise_s": 1.2}, "load": {"constant_n": -97.3},
        "duration_s": 22.0, "seed": 1939079506, "ambient_degc": 26.5, "warm_degc": 7.3,
        "faults": [{"fault": "motor_current_bias", "size": -0.554, "onset_s": 16.15}],
    }  # fmt: skip
    run = SimulatedStand(scenario(**values))
    detections, last = told(tuple(r for r in run if isinstance(r, ChannelTable | Scan)))
    assert [d.detected for d in detections] == [True]
    assert "motor_current_bias" in {member.fault for member in last.members}


def test_a_bias_that_turns_the_current_at_rest_is_no_other_unit() -> None:
    """The bridge seems to lose what it gained: another unit's zero explained that, no bias did."""
    motion = {"kind": "trapezoid", "amplitude_m": 0.0309, "frequency_hz": 0.102}
    bias = {"fault": "motor_current_bias", "size": 0.628, "onset_s": 16.45}
    last = last_verdict(
        motion=motion | {"centre_m": 0.0535, "rise_s": 1.2}, load={"constant_n": 93.5},
        duration_s=22.0, seed=2117708377, unit_seed=343, ambient_degc=26.8, faults=[bias],
    )  # fmt: skip
    assert last.outcome is not Outcome.NOMINAL
    assert "motor_current_bias" in {member.fault for member in last.members}


def test_a_fault_that_no_unit_looks_like_is_asked_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """An episode may last for hours."""
    taken, add = [], ChangeEvidence.add

    def counted(evidence: ChangeEvidence, window: LawWindow) -> None:
        taken.append(window)
        add(evidence, window)

    monkeypatch.setattr(ChangeEvidence, "add", counted)
    detections, _ = told(recorded(5003, switched=False, fault="winding_resistance_rise", size=0.4))
    assert [d.detected for d in detections] == [True]
    assert 0 < len(taken) < 0.5 * (30.0 - SWITCH_S) / WINDOW_S


def test_a_jammed_unit_that_is_as_warm_is_found() -> None:
    detections, last = told(recorded(5018, fault="jam", size=1.0))
    assert any(d.detected for d in detections)
    assert {"jam"} <= {member.fault for member in last.members} <= {"jam", "ball_nut_friction"}


def test_what_began_and_was_nothing_hides_no_later_window() -> None:
    """A current read too small was another unit: the windows in between had gone unweighed."""
    motion = {"kind": "triangle", "amplitude_m": 1.2814, "frequency_hz": 0.174}
    run = SimulatedStand(scenario(
        machine="joint", motion=motion | {"centre_m": 2.229}, load={"constant_n": 0.3},
        duration_s=20.0, seed=1276603337, unit_seed=201, ambient_degc=21.9, warm_degc=5.9,
        faults=[{"fault": "motor_current_scaling", "size": 0.8, "onset_s": 12.84}],
    ))  # fmt: skip
    records = tuple(r for r in run if isinstance(r, ChannelTable | Scan))
    detections, last = told(records, "joint")
    assert [d.detected for d in detections] == [True]
    assert "motor_current_scaling" in {member.fault for member in last.members}
    assert "unit exchanged" not in last.words


@pytest.mark.parametrize("warmer_k", [15.0, -8.0])
def test_a_unit_whose_one_thermocouple_reads_more_is_another_one(warmer_k: float) -> None:
    """It was called an error of that reading, which alone had stepped."""
    detections, last = told(of_wing(7751, warmer_k), "wing")
    assert [(d.detected, d.test) for d in detections] == [(False, ANOTHER_UNIT)]
    assert last.outcome is Outcome.NOMINAL


def test_the_one_thermocouple_alone_is_an_error_of_it() -> None:
    detections, last = told(of_wing(7752, fault="motor_temperature_bias", size=12.0), "wing")
    assert [d.detected for d in detections] == [True]
    assert "motor_temperature_bias" in {member.fault for member in last.members}


def test_a_jammed_unit_that_is_warmer_is_found_by_one_thermocouple() -> None:
    detections, last = told(of_wing(7753, 15.0, fault="jam", size=1.0), "wing")
    assert any(d.detected for d in detections)
    assert {"jam"} <= {member.fault for member in last.members} <= {"jam", "ball_nut_friction"}


@pytest.mark.in_turn(2)
@pytest.mark.parametrize(
    ("stand", "run"), [("flea", lambda: recorded(5014)), ("wing", lambda: of_wing(7751, 15.0))]
)
def test_scans_one_by_one_say_the_same_as_in_blocks(
    stand: str, run: Callable[[], tuple[Record, ...]]
) -> None:
    """From a second before the switch until it is recognised."""
    records = run()[:2300]
    alone, together = (pipeline_of(stand) for _ in range(2))
    single = [*stands.said_in_blocks(alone, records[:1400])]
    single += [said for record in records[1400:] for said in alone.handle(record)]
    blocks = stands.said_in_blocks(together, records)
    of_one, of_many = (
        [r for r in every if isinstance(r, Detection | AmbiguityGroup)]
        for every in (single, blocks)
    )
    assert any(isinstance(r, Detection) for r in of_one)
    assert repr(of_one) == repr(of_many)
