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

"""Isolator and extractor together on a simulated jam: what cannot be computed is passed over."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from support import in_turn, stands
from support.stand_runs import fault, records

from flea_diag.configuration.component import EXTRACTOR, ISOLATOR, OBSERVER, make_pipeline
from flea_diag.configuration.knowledge import load_features
from flea_diag.configuration.stand import load_stand
from flea_diag.core.vibration.features_envelope import named_line
from flea_diag.core.vibration.nominal_range import NominalRanges
from flea_diag.core.vibration.unjudged import said, unjudged
from flea_diag.stages.extractor.windows import Windows
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Outcome,
    Record,
    Scan,
    Truth,
    VibrationBlock,
    VibrationLevel,
)

pytestmark = pytest.mark.slow

S = 1_000_000_000
Spoil = Callable[[int, VibrationBlock], VibrationBlock | None]


@lru_cache(maxsize=1)
def observed() -> tuple[Record, ...]:
    """The stand, and what the observer says to it, in the order of a replay."""
    made = records(
        motion={"kind": "sine", "amplitude_m": 0.022, "frequency_hz": 0.6},
        duration_s=15.0,
        sensors={},
        **fault("jam", 8.0),
    )
    observer = OBSERVER.build(OBSERVER.parameters())
    kept = [r for r in made if isinstance(r, ChannelTable | Scan | VibrationBlock)]
    return tuple(each for record in kept for each in (record, *observer.handle(record)))


def diagnosed(spoil: Spoil, **extractor: float) -> list[Record]:
    stages = (
        ISOLATOR.build(ISOLATOR.parameters()),
        EXTRACTOR.build(EXTRACTOR.parameters(**extractor)),
    )
    chain, out = Pipeline(stages), []
    number = 0
    for record in observed():
        given: Record | None = record
        if isinstance(record, VibrationBlock):
            given, number = spoil(number, record), number + 1
        if given is not None:
            out += chain.handle(given)
    return [*out, *chain.finish()]


def answers(out: list[Record]) -> list[FeatureValue]:
    return [record for record in out if isinstance(record, FeatureValue)]


def last(out: list[Record]) -> AmbiguityGroup:
    return [record for record in out if isinstance(record, AmbiguityGroup)][-1]


def whole(_: int, block: VibrationBlock) -> VibrationBlock:
    return block


def with_gaps(number: int, block: VibrationBlock) -> VibrationBlock | None:
    return None if number % 5 == 0 else block


def absent(_: int, __: VibrationBlock) -> None:
    return None


def clipped(_: int, block: VibrationBlock) -> VibrationBlock:
    """The second accelerometer hits its full scale now and then."""
    offsets, samples = block.points()
    samples = np.array(samples)
    samples[::100, 3:] = 500.0
    return VibrationBlock.pack(block.stamp_ns, block.axes, offsets, samples)


def test_the_jam_is_found_when_all_is_well_and_each_answer_comes_within_its_budget() -> None:
    out = diagnosed(whole)
    assert [member.fault for member in last(out).members] == ["jam"]
    asked = {r.step: r for r in out if isinstance(r, FeatureRequest)}
    assert answers(out)
    for answer in answers(out):
        assert answer.stamp_ns - asked[answer.step].stamp_ns == 150_000_000
        assert answer.cost_ms < 150.0
        assert answer.reason == ""
        assert answer.nominal_low < answer.nominal_high
    detected_ns = last(out).detected_stamp_ns
    assert min(request.window_start_ns for request in asked.values()) >= detected_ns


def test_a_pit_of_half_a_millimetre_is_heard_by_its_kurtosis_and_told_from_the_rest() -> None:
    made = records(
        motion={"kind": "sine", "amplitude_m": 0.022, "frequency_hz": 0.6},
        load={"constant_n": 100.0},
        duration_s=15.0,
        sensors={},
        **fault("spall", 4.0, size=0.5),
    )
    pipeline = make_pipeline(load_stand())
    kept = [r for r in made if isinstance(r, ChannelTable | Scan | VibrationBlock)]
    found = last([*stands.said_in_blocks(pipeline, kept)])
    assert [member.fault for member in found.members] == ["spall"]
    assert re.match(r"accelerometer_2_[xyz]: kurtosis .* in motion", found.opened_by)
    first = found.members[0].evidence[0]
    assert (first.source, first.observed) == ("accelerometer_2_kurtosis", "+")
    assert "accelerometer_2_kurtosis" not in found.features_computed


def test_a_screw_that_shows_no_drag_is_not_jammed() -> None:
    """A pit in slow motion knocks as a jam does; that no relation deviates is held against it."""
    made = records(
        motion={"kind": "sine", "amplitude_m": 0.011, "frequency_hz": 0.4},
        load={"constant_n": -80.0},
        duration_s=20.0,
        sensors={},
        **fault("spall", 8.0, size=1.2),
    )
    pipeline = make_pipeline(load_stand())
    kept = [r for r in made if isinstance(r, ChannelTable | Scan | VibrationBlock)]
    found = last([*stands.said_in_blocks(pipeline, kept)])
    assert [member.fault for member in found.members] == ["spall"]
    (jam,) = [row for row in found.dropped if row.fault == "jam"]
    assert "nats below the most likely fault" in jam.reason


@pytest.mark.parametrize(
    ("spoil", "extractor", "reason"),
    [
        (absent, {}, "no vibration was received"),
        (with_gaps, {}, "a gap of 0.100 s lies in the window|vibration begins|vibration ends"),
        (whole, {"shortest_window_s": 2.0}, "window of 1.000 s is shorter than 2 s"),
    ],
)
def test_without_a_usable_window_features_are_passed_over_and_the_group_stays(
    spoil: Spoil, extractor: dict[str, float], reason: str
) -> None:
    out = diagnosed(spoil, **extractor)
    found = [answer for answer in answers(out) if not answer.feature.startswith("motor_")]
    assert len(found) >= 2
    assert all(re.search(reason, answer.reason) for answer in found)
    assert {answer.symbol for answer in found} == {"?"}
    names = [answer.feature for answer in found]
    assert len(set(names)) * 3 >= len(names)  # three windows at most
    assert "jam" in {member.fault for member in last(out).members}
    assert not any(name.startswith("accelerometer") for name in last(out).features_computed)


def test_a_saturated_sensor_is_passed_over_for_the_other() -> None:
    out = diagnosed(clipped)
    found = answers(out)
    second = [answer for answer in found if answer.feature.startswith("accelerometer_2")]
    assert second
    assert all("is saturated" in answer.reason for answer in second)
    assert any(answer.symbol != "?" for answer in found)
    assert "jam" in {member.fault for member in last(out).members}


def test_the_level_that_opens_an_episode_is_an_answer_already() -> None:
    """A dead sensor: the stand's noise is gone, which no fault of the machine does."""
    made = records(
        motion={"kind": "sine", "amplitude_m": 0.022, "frequency_hz": 0.6},
        duration_s=11.0,
        sensors={},
        faults=[{"fault": "accelerometer_2_fault", "onset_s": 8.0, "size": 0.0}],
    )
    chain = make_pipeline(load_stand())
    kept = [r for r in made if isinstance(r, ChannelTable | Scan | VibrationBlock)]
    group = last(list(stands.said_in_blocks(chain, kept)))
    assert re.match("accelerometer_2_[xyz]: level", group.opened_by)
    assert [member.fault for member in group.members] == ["accelerometer_2_fault"]
    short = next(row for row in group.dropped if row.fault == "winding_short")
    assert ("accelerometer_2_std", "-") in [(e.source, e.observed) for e in short.evidence]


@pytest.mark.parametrize(("faults", "line"), [(fault("spall", 0.0), "nut"), ({}, "unclassified")])
def test_order_tracking_names_the_nut_through_a_simulated_sweep(
    faults: dict[str, Any], line: str
) -> None:
    made = records(
        motion={
            "kind": "sweep",
            "amplitude_m": 0.03,
            "frequency_hz": 0.2,
            "end_frequency_hz": 0.6,
            "centre_m": 0.05,
        },
        sensors={},
        duration_s=9.0,
        unit_spread=0.0,
        **faults,
    )
    windows = Windows(10.0, 0.002, 0.05, load_stand().kinematics.orders())
    for record in made:
        if isinstance(record, Scan | VibrationBlock):
            windows.add(record)
    start_ns = next(record.stamp_ns for record in made if isinstance(record, Scan))
    names = [
        named_line(windows.cut(start_ns + at * S, start_ns + (at + 2) * S, "accelerometer_2"))
        for at in (1, 3, 5, 6)
    ]
    assert names == [line] * 4


def pit_of_another_unit(
    seed: int,
    until_s: float,
    degc: tuple[float, float],
    load_n: float,
    at_s: float,
    size: float,
    **motion: Any,
) -> dict[str, Any]:
    """Scenario: control is switched to a unit with a pit; ``degc`` of the room, and above it."""
    return {
        "seed": seed,
        "duration_s": until_s,
        "ambient_degc": degc[0],
        "warm_degc": degc[1],
        "motion": motion,
        "load": {"constant_n": load_n},
        "switch": {"at_s": at_s},
        "faults": [{"fault": "spall", "size": size, "unit": "X"}],
    }


UNIT_FIRST = pit_of_another_unit(
    90219630, 27.0, (23.8, 0.1), 177.0, 13.9, 1.759,
    kind="trapezoid", amplitude_m=0.0205, frequency_hz=0.089, centre_m=0.0505, rise_s=1.2,
)  # fmt: skip
PIT_FIRST = pit_of_another_unit(
    418501655, 22.0, (20.4, 1.2), 184.5, 12.49, 0.611,
    kind="triangle", amplitude_m=0.0211, frequency_hz=0.271, centre_m=0.0508,
)  # fmt: skip
OTHER_FRICTION = pit_of_another_unit(
    1032047964, 22.0, (21.8, 2.1), -174.2, 13.64, 0.929,
    amplitude_m=0.0196, frequency_hz=0.754, centre_m=0.044,
)  # fmt: skip


@pytest.mark.parametrize(
    ("scenario", "relations"),
    in_turn([(UNIT_FIRST, []), (PIT_FIRST, ["parity_electrical"]), (OTHER_FRICTION, [])], 3),
)
def test_what_another_unit_differs_by_hides_no_pit_that_came_with_it(
    scenario: dict[str, Any], relations: list[str]
) -> None:
    """Whether the law tells its shift, or that opens an episode that vibration may have opened."""
    pipeline = make_pipeline(load_stand())
    made = [r for r in records(**scenario, sensors={}) if not isinstance(r, Truth)]
    out = [*stands.said_in_blocks(pipeline, made)]
    opened = [r.residual for r in out if isinstance(r, Detection) and r.detected]
    assert opened == relations
    assert any("kurtosis" in getattr(r, "opened_by", "") for r in out)
    assert [member.fault for member in last(out).members] == ["spall"]
    assert last(out).outcome is Outcome.ISOLATED


def jammed(size: float) -> tuple[Record, ...]:
    """A jam at 8 s, on a stand with accelerometers."""
    return records(
        motion={"kind": "sine", "amplitude_m": 0.018, "frequency_hz": 0.5},
        duration_s=28.0,
        sensors={},
        **fault("jam", 8.0, size=size),
    )


def verdict_without(kinds: tuple[type, ...], made: tuple[Record, ...]) -> AmbiguityGroup:
    pipeline = make_pipeline(load_stand())
    return last(stands.replay(pipeline, [r for r in made if not isinstance(r, kinds)]))


def test_a_jam_that_all_but_stops_the_actuator_is_called() -> None:
    """What still creeps gives windows enough where it is this or lost lubrication."""
    group = verdict_without((Truth,), jammed(3.0))
    assert [member.fault for member in group.members] == ["jam"]


def test_where_no_feature_could_be_computed_the_verdict_says_that_one_would_split() -> None:
    """The accelerometers are there and say nothing: it is not the sensors that cannot."""
    group = verdict_without((Truth, VibrationBlock), jammed(1.0))
    assert {member.fault for member in group.members} == {"ball_nut_friction", "jam"}
    assert group.features_computed == ()
    assert "not isolated yet; vibration features need" in group.words
    assert "by design" not in group.words


@pytest.mark.parametrize("rate_hz", [10_000.0, 50_000.0])
def test_accelerometers_at_another_rate_are_said_to_be_deaf(rate_hz: float) -> None:
    made = records(
        motion={"kind": "sine", "amplitude_m": 0.022, "frequency_hz": 0.6},
        duration_s=2.0,
        sensors={"vibration_rate_hz": rate_hz},
        **fault("spall", 0.0, size=1.5),
    )
    out = replayed(made)
    verdict = [r for r in out if isinstance(r, AmbiguityGroup)][-1]
    why = f"sampled at {rate_hz:.6g} Hz, nominal ranges were learned at 20000 Hz"
    unseen = {name: reason for name, reason in verdict.not_observable if "vibration" in reason}
    assert {"spall", "rotor_eccentricity"} <= set(unseen)
    assert all(why in reason for reason in unseen.values())
    rows = {r.channel: r for r in [q for q in out if isinstance(q, DataQuality)][-1].channels}
    assert rows["vibration"].reason.startswith(f"accelerometer_1, accelerometer_2: {why}")
    assert not any(isinstance(r, VibrationLevel) for r in out)


def test_accelerometers_without_a_table_are_said_to_be_deaf_and_judged_ones_are_not() -> None:
    nominal = load_features(load_stand().features).nominal
    rates = dict.fromkeys(("accelerometer_1_x", "accelerometer_3_x"), 20_000.0)
    assert unjudged(nominal, rates) == {"accelerometer_3_x": "no nominal range was learned"}
    assert len(unjudged(NominalRanges(), rates)) == 2
    assert said({}) == ""


def replayed(made: list[Record]) -> list[Record]:
    """All that the three stages say to these records."""
    chain = make_pipeline(load_stand(), state_observer="none")
    return stands.replay(chain, (record for record in made if not isinstance(record, Truth)))
