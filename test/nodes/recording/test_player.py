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

"""The player of bags: whom it waits for, what it plays and how it ends."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from support.decisions import BAGS
from support.live import Peer, Process, node

from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Health,
    Outcome,
    Record,
    Scan,
    Truth,
    VibrationBlock,
)
from flea_diag.wire.topics import TOPIC_OF

READ = (ChannelTable, VibrationBlock, Scan)
SOURCES = (*READ, Truth)
BAG = BAGS / "jam"
LIMIT_S = 60.0


def of_diagnoser(record: Record) -> bool:
    """Whether it is the report of the diagnoser on itself."""
    return isinstance(record, Health) and record.node == "diagnoser"


def player(*parameters: str) -> list[str]:
    given = [part for each in parameters for part in ("-p", each)]
    return node("player", *given)


@pytest.mark.in_turn(2)
def test_the_diagnosis_gets_all_that_the_stand_sent_and_nothing_else(domain: int) -> None:
    sent = [record for _, record in BagReader(BAG).records(SOURCES)]
    counts = {kind: sum(isinstance(record, kind) for record in sent) for kind in SOURCES}
    received = {f"{TOPIC_OF[kind].name}/received": str(counts[kind]) for kind in READ}
    with Peer(domain) as peer:
        for kind in (AmbiguityGroup, Health):
            peer.bus.subscribe(kind, peer.records.append)
        diagnoser = node("diagnoser", "-p", "memory:=none")
        play = player(f"bag:={BAG}", "wait_for:=diagnoser")
        with Process(play, domain) as process, Process(diagnoser, domain):
            peer.until(lambda: process.child.poll() is not None, LIMIT_S)
            assert process.end() == 0, process.output
            told = len(peer.records)
            peer.until(lambda: any(map(of_diagnoser, peer.records[told:])), LIMIT_S)
    reports = list(filter(of_diagnoser, peer.records))
    assert f"{len(sent)} records played" in process.output
    assert received.items() <= dict(reports[-1].values).items(), "the diagnoser has them all"
    verdicts = [r for r in peer.records if isinstance(r, AmbiguityGroup)]
    assert verdicts[-1].stale, "the player stays until the last record is judged"
    assert [m.fault for m in verdicts[-1].members] == ["jam"]
    assert verdicts[0].outcome is not Outcome.ISOLATED, "the recorded verdict was not played"


def test_the_player_pauses_while_it_is_inactive(domain: int) -> None:
    with Peer(domain) as peer:
        peer.bus.subscribe(Scan, peer.records.append)
        with Process(player(f"bag:={BAG}"), domain) as process:
            peer.listen(Health)
            peer.find(lambda r: isinstance(r, Scan), LIMIT_S)
            assert peer.change_state("player", "deactivate")
            process.wait_for("deactivated: the bag pauses", LIMIT_S)
            assert peer.change_state("player", "activate")
            before = sum(isinstance(r, Scan) for r in peer.records)
            peer.until(lambda: sum(isinstance(r, Scan) for r in peer.records) > before + 50)
    stamps = [record.stamp_ns for record in peer.records if isinstance(record, Scan)]
    assert {b - a for a, b in itertools.pairwise(stamps)} == {10_000_000}


def test_what_is_no_bag_is_refused_with_one_line(domain: int, tmp_path: Path) -> None:
    for parameters, words in (
        ((), "bag = '': name the bag to play"),
        ((f"bag:={tmp_path}",), str(tmp_path)),
        ((f"bag:={BAG}", "rate:=-1.0"), "rate = -1.0 is below its limit 0.01"),
        ((f"bag:={BAG}", "wait_for:=nobody", "wait_s:=0.1"), "nobody (not started)"),
    ):
        with Process(player(*parameters), domain) as process:
            assert process.end() == 2, process.output
            assert words in process.output
            assert len(process.output.splitlines()) == 1, process.output


def test_a_bag_beside_a_live_stand_is_refused_unless_asked_for(domain: int) -> None:
    with Peer(domain, name="daq") as peer:
        peer.bus.advertise(Scan)
        with Process(player(f"bag:={BAG}"), domain) as process:
            peer.until(lambda: process.child.poll() is not None, LIMIT_S)
            assert process.end() == 2
        assert "/sensors/slow is published by /daq: a bag beside a live stand" in process.output
        with Process(player(f"bag:={BAG}", "beside:=true", "rate:=100.0"), domain) as process:
            process.wait_for("records played", LIMIT_S)
