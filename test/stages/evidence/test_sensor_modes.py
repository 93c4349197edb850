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

"""Modes of one sensor by what its own tests have shown, and by what they have not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.places import FLEA_STAND

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import load_stand
from flea_diag.core.faults.fault import Fault
from flea_diag.stages.evidence.sensor_modes import (
    MOVED_S,
    SHOWN_S,
    ChannelMotion,
    SensorKnowledge,
    SensorModes,
)
from flea_diag.wire.blocks import ResidualBlock

PERIOD_S = 0.01
POSITION = "actuator_position"
TESTS = (POSITION, *(f"{POSITION}_{test}" for test in ("noise", "stuck", "dropout")))
SPEED = f"d({POSITION})"


def faults() -> dict[str, Fault]:
    stand = load_stand(str(FLEA_STAND))
    every = faults_of(stand.actuator, stand.faults)
    return {name: fault for name, fault in every.items() if fault.channel == POSITION}


def modes(unseen: tuple[str, ...] = ()) -> SensorModes:
    motion = {POSITION: ChannelMotion(SPEED, 1e-3)}
    return SensorModes(SensorKnowledge(TESTS, faults(), motion, unseen, PERIOD_S))


def block(seconds: float, speed: float = 0.0, **z: float) -> ResidualBlock:
    """Scans in all of which these tests have a value; limits are 1."""
    count = round(seconds / PERIOD_S)
    values = np.tile([z.get(name, 0.0) for name in TESTS], (count, 1))
    none = np.empty((count, 0))
    return ResidualBlock(
        np.arange(count), TESTS, values, values, np.ones_like(values), (SPEED,),
        np.full((count, 1), speed), (), none, none, none,
    )  # fmt: skip


def possible(*blocks: ResidualBlock, unseen: tuple[str, ...] = ()) -> set[str]:
    made = modes(unseen)
    for each in blocks:
        made.take(each, slice(0, len(each)))
    return {name.removeprefix(f"{POSITION}_") for name in made.possible()}


LATER = SHOWN_S + 1.0
NOISE = {f"{POSITION}_noise": 2.0}
DROPOUT = {f"{POSITION}_dropout": 2.0}
STUCK = {f"{POSITION}_stuck": 2.0}


@pytest.mark.parametrize(
    ("blocks", "left"),
    [
        ([block(0.1, **NOISE)], {"noise", "dropout"}),
        ([block(0.1, **NOISE), block(LATER)], {"noise"}),
        ([block(0.1, **NOISE), block(LATER, **DROPOUT)], {"dropout"}),
        ([block(0.1, **STUCK)], {"dead"}),
        ([block(0.1, **{POSITION: 2.0})], {"bias", "scaling", "dead", "noise", "dropout"}),
        ([block(0.1, **{POSITION: 2.0}), block(LATER, speed=0.1)], {"bias", "scaling"}),
        ([block(0.1, **{POSITION: 2.0}), block(LATER)], {"bias", "scaling", "dead"}),
        ([block(0.1, **{POSITION: 2.0}), block(LATER, **NOISE)], {"noise"}),
    ],
)  # fmt: skip
def test_a_mode_is_what_has_shown_and_what_had_no_time_to(
    blocks: list[ResidualBlock], left: set[str]
) -> None:
    assert possible(*blocks) == left


def test_a_dead_reading_that_no_test_can_show_is_left_to_the_relations() -> None:
    dead = f"{POSITION}_dead"
    assert dead in modes().faults
    assert modes((POSITION,)).faults == modes().faults - {dead}


def test_a_reading_that_goes_on_moving_is_not_dead_however_the_blocks_are_cut() -> None:
    step = block(0.1, **{POSITION: 2.0})
    pieces = [block(0.5 * MOVED_S + PERIOD_S, speed=-0.1)] * 2
    assert "dead" in possible(step, pieces[0])
    assert "dead" not in possible(step, *pieces)


def test_where_nothing_has_responded_nothing_is_said() -> None:
    made = modes()
    quiet = block(LATER)
    assert made.take(quiet, slice(0, len(quiet))) == len(quiet)
    assert not made
    assert made.possible() == ()


def test_a_position_that_steps_may_be_a_play_that_opens() -> None:
    """Of two positions with a play between them; the relations tell which it is."""
    played = replace(next(iter(faults().values())), name="backlash", channel="", mode="")
    every = {**faults(), "backlash": played}
    known = SensorKnowledge(TESTS, every, {}, (), PERIOD_S, {"backlash"})
    made = SensorModes(known)
    made.take(block(0.1, **{POSITION: 2.0}), slice(0, 10))
    assert {"backlash", f"{POSITION}_bias"} <= set(made.possible())
    made.take(block(LATER, **NOISE), slice(0, round(LATER / PERIOD_S)))
    assert "backlash" not in made.possible()
