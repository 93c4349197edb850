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

"""The ledger: shares by hand, whatever the partition; what was not judged, and why."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from support import stands
from support.models import linear_ema as ema
from support.observer_scans import after, healthy

from flea_diag.core.residual_values import ResidualRows
from flea_diag.core.scan_counts import ScanCounts
from flea_diag.stages.judgement.ledger import JudgementLedger
from flea_diag.wire.records import (
    AmbiguityGroup,
    Cause,
    DataQuality,
    JudgedTest,
    Outcome,
    Record,
    Scan,
)

TESTED = ("parity_mechanical", "parity_mechanical_dn", "nut_temperature", "load_force_stuck")
SECOND_NS = 1_000_000_000


class Stream:
    """A ledger at 10 scans a second, fed with what the test says."""

    def __init__(self) -> None:
        self.known = stands.relations().residuals
        self.ledger = JudgementLedger(self.known, TESTED, ema.STAND, ScanCounts(0.1))
        self.ledger.begin(0)
        self.scans = 0
        self.turns: list[int] = []

    def take(
        self,
        scans: int,
        formed: bool = True,
        moving: bool = True,
        lacking: str = "",
        unheated: bool = False,
        outside: bool = False,
    ) -> None:
        rows = np.zeros((1, len(self.known.channels)))
        if lacking:
            rows[:, self.known.index[lacking]] = math.nan
        z = np.full((1, len(self.known.rows)), 0.0 if formed else math.nan)
        z[:, self.known.column("load_force_stuck")] = 0.0
        z[:, self.known.column("nut_temperature")] = math.nan if unheated else 0.0
        residuals = ResidualRows(z, z[:, :0, None], z[:, :0], np.zeros((1, 2)), np.array([moving]))
        for _ in range(scans):
            stamps_ns = np.array([self.scans * SECOND_NS // 10])
            if not self.ledger.take(stamps_ns, rows, residuals, z, False, outside):
                self.turns.append(self.scans)
            self.scans += 1

    def of(self, test: str) -> JudgedTest:
        return next(row for row in self.ledger.report() if row.residual == test)


def test_shares_are_those_counted_by_hand() -> None:
    stream = Stream()
    stream.take(30)
    stream.take(10, moving=False)
    stream.take(81)  # the second that began with the last scan is not over
    mechanical = stream.of("parity_mechanical")
    assert (mechanical.recent, mechanical.run) == (0.9, 110 / 120)
    assert (mechanical.cause, mechanical.why) == (Cause.AT_REST, "at rest in 10 % of the scans")
    assert stream.of("nut_temperature") == JudgedTest("nut_temperature", 1.0, 1.0)
    assert not stream.turns


def test_too_little_to_judge_is_said_once_it_should_have_been_judged_for_three_seconds() -> None:
    stream = Stream()
    stream.take(20, formed=False, moving=False)
    stream.take(31, formed=False, lacking="load_force")
    assert stream.turns == [50]
    row = stream.of("parity_mechanical")
    assert (row.judged, row.cause) == (False, Cause.MISSING)
    assert row.why == "load_force lacks 60 % of its readings"
    stuck = stream.of("load_force_stuck")
    assert (stuck.recent, stuck.judged) == (0.4, True)
    stream.take(100)  # it counts as judged again from three tenths of the last 10 s on
    assert stream.turns == [50, 70]
    assert stream.of("parity_mechanical").judged


def test_a_temperature_whose_heat_is_unknown_counts_as_not_judged() -> None:
    stream = Stream()
    stream.take(5, unheated=True)
    stream.take(10)
    stream.take(20, unheated=True, lacking="nut_temperature")
    assert stream.of("nut_temperature").why == "nut_temperature lacks 50 % of its readings"
    stream.take(116, unheated=True)
    row = stream.of("nut_temperature")
    assert (row.recent, row.judged, row.cause) == (0.0, False, Cause.UNFORMED)
    assert row.why == "what heats it is unknown in all of the scans"
    stream.take(40)
    assert stream.of("nut_temperature").judged


def test_a_pause_is_no_judgement_and_lost_scans_are_a_gap() -> None:
    stream = Stream()
    stream.take(5, formed=False)
    stream.ledger.lose(5)
    stream.scans = 205
    stream.take(40)
    assert stream.of("nut_temperature").run == 1.0
    stream.take(10, formed=False)
    stream.ledger.lose(3)
    stream.take(10)
    assert stream.of("parity_mechanical").cause is Cause.GAP


def test_the_cause_is_what_takes_most_scans() -> None:
    stream = Stream()
    stream.take(1, formed=False, lacking="load_force")
    stream.take(50, formed=False, outside=True)
    row = stream.of("parity_mechanical")
    assert (row.judged, row.cause) == (False, Cause.OUTSIDE)
    stream.take(60, formed=False, lacking="load_force")
    assert stream.of("parity_mechanical").why == "load_force lacks 60 % of its readings"


def lacking(channel: str, every: int) -> list[Scan]:
    """One reading in so many is there."""
    return [
        after(scan, **{channel: math.nan}) if k % every else scan
        for k, scan in enumerate(healthy())
    ]


def said(records: Iterable[Record]) -> AmbiguityGroup:
    return stands.of(AmbiguityGroup, list(records))[-1]


@pytest.mark.parametrize("every", [5, 20, 31])
def test_nothing_is_nominal_whose_friction_was_not_judged(every: int) -> None:
    verdict = said(
        stands.replay(stands.pipeline(), [stands.table(), *lacking("load_force", every)])
    )
    assert verdict.outcome is Outcome.DATA_UNUSABLE
    assert verdict.words.startswith("not judged in the last 10 s: parity_mechanical (load_force")
    why = dict(verdict.not_observable)
    assert "load_force lacks" in why["jam"]
    assert "winding_short" not in why  # the circuit was judged


def test_a_relation_that_is_not_judged_is_named_beside_no_deviation() -> None:
    spoilt = lacking("motor_temperature", 20)
    verdict = said(stands.replay(stands.pipeline(), [stands.table(), *spoilt]))
    whole = said(stands.replay(stands.pipeline(), [stands.table(), *healthy()]))
    assert verdict.outcome is whole.outcome is Outcome.NOMINAL
    assert whole.words == "no deviation"
    assert verdict.words.startswith(
        "no deviation in what was judged; not judged in the last 10 s: "
    )
    assert "motor_temperature lacks 95 % of its readings" in verdict.words
    assert len(verdict.not_observable) > len(whole.not_observable)


@pytest.mark.in_turn(2)
@pytest.mark.slow
def test_blocks_and_single_scans_give_the_same_ledger() -> None:
    spoilt = [stands.table(), *lacking("load_force", 5)]
    single = stands.of(DataQuality, stands.feed(stands.observer(), spoilt))
    blocks = stands.of(DataQuality, stands.replay(stands.observer(), spoilt))
    assert single == blocks
    assert not all(row.judged for row in single[-1].judged)
