"""The player of bags: whom it waits for, what it plays and how it ends."""

from __future__ import annotations

import itertools
from pathlib import Path

from support.decisions import BAGS
from support.live import Peer, Process, node

from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Health,
    Outcome,
    Scan,
    Truth,
    VibrationBlock,
)
from flea_diag.wire.topics import TOPIC_OF

SOURCES = (ChannelTable, VibrationBlock, Scan, Truth)
BAG = BAGS / "jam"
LIMIT_S = 60.0


def player(*parameters: str) -> list[str]:
    given = [part for each in parameters for part in ("-p", each)]
    return node("flea_diag.nodes.recording.player", *given)


def test_the_diagnosis_gets_all_that_the_stand_sent_and_nothing_else(domain: int) -> None:
    sent = [record for _, record in BagReader(BAG).records(SOURCES)]
    with Peer(domain) as peer:
        for kind in (*SOURCES, AmbiguityGroup, Health):
            peer.bus.subscribe(kind, peer.records.append)
        diagnoser = node("flea_diag.nodes.diagnoser", "-p", "memory:=none")
        play = player(f"bag:={BAG}", "rate:=2.0", "wait_for:=diagnoser")
        with Process(play, domain) as process, Process(diagnoser, domain):
            peer.until(lambda: process.child.poll() is not None, LIMIT_S)
            assert process.end() == 0, process.output
    assert f"{len(sent)} records played" in process.output
    counted = [r.values for r in peer.records if isinstance(r, Health) and r.node == "diagnoser"]
    for kind in (ChannelTable, VibrationBlock, Scan):
        count = sum(isinstance(record, kind) for record in sent)
        topic = TOPIC_OF[kind].name
        assert dict(counted[-1])[f"{topic}/received"] == str(count), "the diagnoser has them all"
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
