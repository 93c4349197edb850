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

"""A recorded diagnosis: summaries and hypotheses give the digests of what was decided."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from support.live import ROOT

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.stages.digest import DECISIONS
from flea_diag.tools.replay.replay import diagnosed, replay, sources
from flea_diag.tools.replay.size_estimates import estimates
from flea_diag.wire.bags.bag import BagReader, BagWriter
from flea_diag.wire.messages.summary import summary
from flea_diag.wire.records import AmbiguityGroup, Hypotheses, Record, Scan

JAM = ROOT / "bags" / "jam"


@pytest.fixture(scope="module")
def decisions() -> list[Record]:
    """What a diagnosis of the jam decides."""
    said = diagnosed(BagReader(JAM).blocks(sources()), make_pipeline(load_stand()))
    return [record for record in said if isinstance(record, DECISIONS)]


def recorded(bag: Path, decisions: Iterable[Record], kinds: tuple[type, ...]) -> Path:
    """A bag as the recorder writes it: each verdict in both orders of arrival, and repeated."""
    scan = next(record for _, record in BagReader(JAM).records((Scan,)))
    with BagWriter(bag) as writer:
        writer.write(scan)
        for number, record in enumerate(decisions):
            parts: tuple[Record, ...] = (record,)
            if isinstance(record, AmbiguityGroup):
                brief = replace(summary(record), seq=number)
                pair = (brief, record.hypotheses()) if number % 2 else (record.hypotheses(), brief)
                parts = (*pair, replace(brief, seq=number + 100, stale=True))
            for part in parts:
                if isinstance(part, kinds):
                    writer.write(part)
    return bag


def test_the_recorded_digest_is_that_of_the_whole_verdicts(
    decisions: list[Record], tmp_path: Path
) -> None:
    bag = recorded(tmp_path / "bag", decisions, (*DECISIONS, Hypotheses))
    expected = replay(JAM, make_pipeline(load_stand()))
    found = replay(bag, make_pipeline(load_stand()))
    assert found["recorded_digest"] == expected["digest"]
    assert found["recorded_decision_digest"] == expected["decision_digest"]


def test_summaries_alone_give_no_digest(decisions: list[Record], tmp_path: Path) -> None:
    bag = recorded(tmp_path / "bag", decisions, DECISIONS)
    found = replay(bag, make_pipeline(load_stand()))
    assert (found["recorded_digest"], found["recorded_decision_digest"]) == (None, None)


def test_the_trend_takes_the_sizes_from_the_hypotheses(
    decisions: list[Record], tmp_path: Path
) -> None:
    bag = recorded(tmp_path / "bag", decisions, (*DECISIONS, Hypotheses))
    last = [record for record in decisions if isinstance(record, AmbiguityGroup)][-1]
    (found,) = estimates(bag)
    assert (found.fault, found.size) == (last.members[0].fault, last.members[0].size)
