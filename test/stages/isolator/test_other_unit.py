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

"""A healthy unit that is none of the calibration's: said, learned, never a fault of a sensor."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import pytest
from support import stands
from support.models import linear_ema as ema

from flea_diag.configuration import knowledge as of_stand
from flea_diag.core.residuals.parameters import UnitSpread
from flea_diag.stages.isolator.isolator import IsolatorParameters, IsolatorStage
from flea_diag.stages.observer.observer import ObserverStage
from flea_diag.stages.observer.observer_parameters import ObserverParameters
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import (
    OTHER_UNIT,
    AmbiguityGroup,
    DataQuality,
    Outcome,
    Quality,
    Record,
    Remark,
    RemarkKind,
    Scan,
)

RESISTANCE = "winding_resistance_ohm"
ONE_UNIT = UnitSpread(1, {RESISTANCE: 0.01, "back_emf_v_s_per_m": 0.5})


@lru_cache(maxsize=8)
def diagnosed(
    resistance: float, tolerance: float = 0.3, *decisions: Remark, bias_from_s: float = math.inf
) -> tuple[Record, ...]:
    """12 s of a unit with so much resistance, by a calibration of one other unit.

    It is healthy, but for a motor current that reads 0.3 A too much ``bias_from_s`` on.
    """
    unit = ema.changed(resistance=ema.HEALTHY.resistance + resistance)
    known = stands.calibration()
    spread = replace(known.tolerance, winding_resistance_ohm=tolerance)
    known = replace(known, units=ONE_UNIT, tolerance=spread)
    observer = ObserverStage(known, of_stand.effects(stands.STAND, known), ObserverParameters())
    isolator = IsolatorStage(of_stand.knowledge(stands.STAND, known), IsolatorParameters())
    scans = stands.scans(ema.noisy(ema.run(unit, seconds=12.0), 71))
    onset_ns = stands.START_NS + 1e9 * bias_from_s
    scans = [biased(scan) if scan.stamp_ns >= onset_ns else scan for scan in scans]
    given = sorted((stands.table(), *scans, *decisions), key=lambda record: record.stamp_ns)
    return tuple(stands.replay(Pipeline((observer, isolator)), given))


def biased(scan: Scan) -> Scan:
    assert scan.channels[0] == "motor_current"
    return replace(scan, values=(scan.values[0] + 0.3, *scan.values[1:]))


def row(records: tuple[Record, ...]):
    (last,) = (r for r in stands.of(DataQuality, records)[-1].channels if r.channel == OTHER_UNIT)
    return last


def test_the_calibrated_unit_is_no_other() -> None:
    channels = stands.of(DataQuality, diagnosed(0.0))[-1].channels
    assert OTHER_UNIT not in [r.channel for r in channels]


def test_another_unit_within_the_tolerance_is_learned_as_its_baseline() -> None:
    found = row(diagnosed(0.35))
    assert found.quality is Quality.GOOD
    assert found.reason.startswith("another unit than calibrated: winding_resistance_ohm +0.3")
    learned = {o.parameter: o.value for o in stands.of(DataQuality, diagnosed(0.35))[-1].offsets}
    assert learned[RESISTANCE] == pytest.approx(ema.HEALTHY.resistance + 0.35, abs=0.05)
    assert stands.verdict(diagnosed(0.35)).outcome is Outcome.NOMINAL


def test_beyond_the_tolerance_the_calibration_does_not_fit() -> None:
    """With an alarm of its own or without, and never as a fault of the voltage sensor."""
    found = diagnosed(0.6, 0.05)
    assert row(found).quality is Quality.SATURATED
    last = stands.verdict(found)
    assert last.outcome is Outcome.MODEL_MISMATCH
    assert RESISTANCE in last.words


@pytest.mark.parametrize(("bias_from_s", "is_of_unit"), [(6.5, True), (9.0, False)])
def test_a_sensor_is_blamed_only_for_what_begins_after_the_start(
    bias_from_s: float, is_of_unit: bool
) -> None:
    last = stands.verdict(diagnosed(0.35, bias_from_s=bias_from_s))
    assert (last.outcome is Outcome.MODEL_MISMATCH) is is_of_unit
    assert "motor_current_bias" in stands.members(last)


BEYOND = (0.6, 0.05)
ACCEPTED, REJECTED = RemarkKind.UNIT_ACCEPTED, RemarkKind.UNIT_REJECTED


def decided(kind: RemarkKind, at_s: float, of_ns: int = 0) -> Remark:
    stamp_ns = stands.START_NS + round(at_s * 1e9)
    told_ns = of_ns or row(diagnosed(*BEYOND)).since_ns
    return Remark(stamp_ns, kind, "Ada", "rewound", "", told_ns)


@pytest.mark.slow
def test_an_operator_accepts_a_unit_and_takes_that_back() -> None:
    accepted = diagnosed(*BEYOND, decided(ACCEPTED, 10.0))
    said_ns = stands.START_NS + 10 * 10**9
    before = [v for v in stands.of(AmbiguityGroup, accepted) if v.stamp_ns < said_ns]
    assert before[-1].outcome is Outcome.MODEL_MISMATCH
    last = stands.verdict(accepted)
    assert last.outcome is Outcome.NOMINAL
    assert "unit accepted as healthy by 'Ada' 10.0" in last.words
    assert "rewound" in last.words
    back = diagnosed(*BEYOND, decided(ACCEPTED, 10.0), decided(REJECTED, 11.0))
    assert stands.verdict(back).outcome is Outcome.MODEL_MISMATCH
    assert "accepted" not in stands.verdict(back).words


@pytest.mark.slow
@pytest.mark.parametrize(
    "said",
    [
        decided(ACCEPTED, 10.0, of_ns=stands.START_NS + 1),
        Remark(stands.START_NS + 10 * 10**9, RemarkKind.MARK, "Ada", "unit accepted"),
    ],
    ids=["of another start", "a mark"],
)
def test_what_is_said_of_something_else_accepts_no_unit(said: Remark) -> None:
    assert stands.verdict(diagnosed(*BEYOND, said)).outcome is Outcome.MODEL_MISMATCH
