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

"""The faults that a verdict has looked for: of the catalogue, what would have been found."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support import stands
from support.observer_scans import healthy
from support.verdicts import group

from flea_diag.core.scan_counts import ScanCounts
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.stages.judgement.looked_for import LookedFor
from flea_diag.stages.judgement.unjudged import Unjudged
from flea_diag.wire.records import (
    AmbiguityGroup,
    Cause,
    ChannelQuality,
    DataQuality,
    JudgedTest,
    Outcome,
    Quality,
)

TESTS = {
    "jam": frozenset({"parity_mechanical"}),
    "load_force_dead": frozenset({"parity_mechanical", "load_force_stuck"}),
}
FAULTS = ("spall", *TESTS)
VOID = JudgedTest("parity_mechanical", 0.0, 0.4, False, Cause.VOID, "void at an end of travel")


@pytest.mark.parametrize(
    ("outcome", "starved", "expected"),
    [
        (Outcome.NOMINAL, False, ("jam", "load_force_dead")),
        (Outcome.ISOLATED, False, ("jam", "load_force_dead")),
        (Outcome.NOT_OBSERVABLE, False, ("load_force_dead",)),
        (Outcome.MODEL_MISMATCH, False, ()),
        (Outcome.DATA_UNUSABLE, True, ()),
    ],
)
def test_what_an_outcome_leaves_to_look_for(
    outcome: Outcome, starved: bool, expected: tuple[str, ...]
) -> None:
    looked_for = LookedFor(FAULTS, TESTS, stands.relations().residuals)
    verdict = replace(group(outcome), not_observable=(("spall", "no accelerometer"),))
    assert looked_for.of(verdict, starved) == expected


def test_until_it_moves_only_sensors_are_looked_at() -> None:
    said = stands.replay(stands.pipeline(), [stands.table(), *healthy()[:400]])
    first, *_, last = stands.of(AmbiguityGroup, said)
    assert (first.outcome, last.outcome) == (Outcome.NOT_OBSERVABLE, Outcome.NOMINAL)
    assert "motor_current_noise" in first.looked_for
    assert "jam" not in first.looked_for
    assert "jam" in last.looked_for


def test_what_a_stop_keeps_from_judging_is_not_looked_for_and_is_no_loss_of_data() -> None:
    known = stands.relations().residuals
    found = Unjudged.of(DataQuality(0, (), (), (VOID,)), known)
    assert found.names == ("parity_mechanical",)
    assert found.words() == ""
    assert found.nothing_left(known.relations, "parity_mechanical") == ""
    why = "not looked for in the last 10 s: parity_mechanical (void at an end of travel)"
    assert found.faults(TESTS) == (("jam", why),)
    whole = replace(VOID, residual="parity_mechanical_dn", judged=True)
    assert Unjudged.of(DataQuality(0, (), (), (VOID, whole)), known).names == ()


def test_words_of_what_was_not_judged_are_of_when_it_or_a_channel_turned() -> None:
    """Shares that a live node says in between change no verdict: a replay does not have them."""
    stand = StandStatus(ScanCounts(0.01), stands.relations().residuals)
    lost = replace(VOID, cause=Cause.MISSING, why="load_force lacks 91 % of its readings")
    later = replace(lost, why="load_force lacks all of its readings")
    bad = ChannelQuality("load_force", Quality.BAD, 5, "dead")
    stand.take(DataQuality(1, (), (), (lost,)))
    stand.take(DataQuality(2, (), (), (later,)))
    assert stand.unjudged.why["parity_mechanical"] == lost.why
    stand.take(DataQuality(3, (bad,), (), (later,)))
    assert stand.unjudged.why["parity_mechanical"] == later.why
