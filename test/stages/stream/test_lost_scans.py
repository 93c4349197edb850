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

"""Scans that were lost on the way are no fault of the actuator, and a fault is still found."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from support import in_turn, stands
from support.decisions import BAGS

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.stages.evidence.evidence_group import TOLD_WINDOWS
from flea_diag.tools.evaluate.case_run import diagnose
from flea_diag.tools.replay.summary import summarise
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import (
    STARVING,
    AmbiguityGroup,
    ChannelTable,
    Outcome,
    Record,
    Scan,
)

pytestmark = pytest.mark.slow


@cache
def records(bag: str) -> tuple[Record, ...]:
    return tuple(record for _, record in BagReader(BAGS / bag).records((ChannelTable, Scan)))


def diagnosed(bag: str, lost: Callable[[int], bool]) -> dict[str, Any]:
    """Summary of a bag of which the scans for which ``lost`` holds never came."""
    counted = itertools.count(1)
    came = [r for r in records(bag) if not (isinstance(r, Scan) and lost(next(counted)))]
    return summarise(diagnose(came, make_pipeline(load_stand())).kept)


@pytest.mark.parametrize("run", [1, 3, 8, 12])
def test_a_run_of_lost_scans_is_no_fault(run: int) -> None:
    told = diagnosed("nominal", lambda k: 1000 <= k < 1000 + run)
    assert (told["outcome"], told["episodes"]) == ("NOMINAL", [])


def some(seed: int, share: float) -> Callable[[int], bool]:
    draw = random.Random(seed)
    return lambda _: draw.random() < share


@pytest.mark.parametrize("bag", in_turn(["winding_short", "live_motor_current_bias"], 2))
def test_a_fault_is_found_with_one_in_five_lost(bag: str) -> None:
    """That a healthy run stays quiet is held by ``test_lossy.py``.

    The law, which sees less, may take its two seconds to tell a short from another unit.
    """
    whole, sparse = diagnosed(bag, lambda _: False), diagnosed(bag, some(3, 0.2))
    assert sparse["ambiguity_group"] == whole["ambiguity_group"]
    assert -0.3 < sparse["detected_at_s"] - whole["detected_at_s"] < 0.3 + TOLD_WINDOWS * WINDOW_S


def test_a_starved_stream_is_said_and_no_fault() -> None:
    """Three of four scans are lost for some seconds: nobody can tell, and then one can again."""
    draw = some(5, 0.75)
    run = [record for record in records("nominal") if not isinstance(record, Scan)]
    scans = [record for record in records("nominal") if isinstance(record, Scan)]
    kept = [scan for k, scan in enumerate(scans) if not (800 <= k < 1400 and draw(k))]
    everything = stands.said_in_blocks(make_pipeline(load_stand()), (*run, *kept))
    said = stands.of(AmbiguityGroup, everything)
    told = [(group.outcome, group.stamp_ns - scans[0].stamp_ns) for group in said]
    turns = [told[0], *(b for a, b in itertools.pairwise(told) if a[0] is not b[0])]
    assert [outcome for outcome, _ in turns] == [
        Outcome.NOT_OBSERVABLE, Outcome.NOMINAL, Outcome.DATA_UNUSABLE, Outcome.NOMINAL
    ]  # fmt: skip
    assert [ns / 1e9 for _, ns in turns[2:]] == pytest.approx([9.5, 14.5], abs=1.0)
    assert {g.words for g in said if g.outcome is Outcome.DATA_UNUSABLE} == {STARVING}
