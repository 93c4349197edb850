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

"""An isolator that is killed and comes back in mid-run.

Latched topics tell it of the episode, and the verdict that its node keeps of the group so far.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from support import stands

from flea_diag.configuration.component import DIAGNOSER, ISOLATOR, OBSERVER
from flea_diag.core.state_copy import state_copy
from flea_diag.stages.pipeline import Pipeline
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    Outcome,
    Record,
    Symbols,
    Truth,
)
from flea_sim_driver.scenario.scenario_file import scenario_from_mapping
from flea_sim_driver.stand import SimulatedStand

pytestmark = pytest.mark.slow

S = 1_000_000_000
ONSET_S, AWAY_S, END_S = 8.1, 2.0, 22.0
LATCHED = (ChannelTable, Symbols, DataQuality, Detection)


@cache
def jammed() -> tuple[Record, ...]:
    fault = {"fault": "jam", "onset_s": ONSET_S}
    given = {"duration_s": END_S, "seed": 0, "faults": [fault], "sensors": {"vibration": False}}
    stand = SimulatedStand(scenario_from_mapping(given, "jam"))
    return tuple(record for record in stand if not isinstance(record, Truth))


def between(begin_s: float, end_s: float) -> list[Record]:
    """What the stand sends from one time on until another."""
    start_ns = jammed()[0].stamp_ns
    return [each for each in jammed() if begin_s <= (each.stamp_ns - start_ns) / S < end_s]


class Stand:
    """An observer that lives on, and isolators that come and go."""

    @staticmethod
    def after(killed_s: float) -> Stand:
        """Its state at the return, of a run until then that is made once."""
        return state_copy(_until_return(killed_s))

    def __init__(self, killed_s: float, away_s: float = AWAY_S) -> None:
        """An isolator was killed, and none was there for a while."""
        self.observer = OBSERVER.build(DIAGNOSER.parameters())
        self.latched: dict[type, Record] = {}
        first = ISOLATOR.build(DIAGNOSER.parameters())
        kept = self._run(Pipeline((self.observer, first)), between(0.0, killed_s))
        self.kept = stands.verdict(kept)
        self._run(Pipeline((self.observer,)), between(killed_s, killed_s + away_s))
        self.back_s = killed_s + away_s

    def _run(self, pipeline: Pipeline, sent: list[Record]) -> list[Record]:
        said = list(stands.said_in_blocks(pipeline, sent))
        records = (each for each in (*sent, *said) if isinstance(each, LATCHED))
        self.latched |= {type(each): each for each in records}
        return said

    def groups(
        self, recalled: AmbiguityGroup | None, deaf: int, until_s: float = END_S
    ) -> list[AmbiguityGroup]:
        """What a second isolator says, to whom latched topics come only after ``deaf`` scans."""
        fresh = ISOLATOR.build(DIAGNOSER.parameters())
        said = list(fresh.handle(recalled)) if recalled is not None else []
        both, late = Pipeline((self.observer, fresh)), between(self.back_s, until_s)
        said += self._run(both, late[:deaf])
        said += [each for kind in LATCHED for each in fresh.handle(self.latched[kind])]
        said += self._run(both, late[deaf:])
        return [group for group in stands.of(AmbiguityGroup, said) if group.episode]


@cache
def _until_return(killed_s: float) -> Stand:
    return Stand(killed_s)


@pytest.mark.parametrize("deaf", [0, 60])
@pytest.mark.parametrize("killed_s", [9.6, 17.0])
def test_no_verdict_is_wrong_and_the_fault_is_named_again(killed_s: float, deaf: int) -> None:
    """Symbols from before are of a motion that it has not seen, and its evidence begins anew."""
    groups = Stand.after(killed_s).groups(None, deaf)
    assert groups
    for group in groups:
        assert "jam" in stands.members(group), group.words
        assert group.outcome not in (Outcome.MODEL_MISMATCH, Outcome.UNEXPLAINED), group.words
    assert stands.members(groups[-1]) <= {"jam", "ball_nut_friction"}


@pytest.mark.parametrize("deaf", [0, 60])
@pytest.mark.parametrize("killed_s", [9.6, 17.0])
def test_what_was_dropped_before_is_never_named_again(killed_s: float, deaf: int) -> None:
    """Both at the moment of the return and with all evidence since: groups only shrink."""
    stand = Stand.after(killed_s)
    before = stand.kept
    assert before.dropped
    for group in stand.groups(before, deaf):
        assert "jam" in stands.members(group) <= stands.members(before), group.words
        assert group.episode == before.episode
        assert group.detected_stamp_ns == before.detected_stamp_ns
        assert group.step > before.step
        assert "isolator restarted in this episode" in group.words
        dropped = {each.fault: each.reason for each in group.dropped}
        assert dropped.items() >= {each.fault: each.reason for each in before.dropped}.items()


@pytest.mark.parametrize("deaf", [0, 60])
@pytest.mark.parametrize("why", ["before the detection", "after the return", "no episode"])
def test_a_verdict_of_another_episode_or_run_tells_nothing(why: str, deaf: int) -> None:
    stand = Stand.after(9.6)
    before, earliest = stand.kept, jammed()[0].stamp_ns
    other = {
        "before the detection": replace(before, stamp_ns=before.detected_stamp_ns - 1),
        "after the return": replace(before, stamp_ns=earliest + round((stand.back_s + 1.0) * S)),
        "no episode": replace(before, episode=0),
    }[why]
    until_s = stand.back_s + 1.0
    told, untold = stand.groups(other, deaf, until_s), Stand.after(9.6).groups(None, deaf, until_s)
    assert told == untold
    assert stands.members(untold[0]) > stands.members(before)
