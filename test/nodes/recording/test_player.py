"""The player of bags: whom it waits for, what it plays and how it ends."""

from __future__ import annotations

import itertools
from pathlib import Path

from support.decisions import BAGS
from support.live import Peer, Process, node

from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.records import AmbiguityGroup, ChannelTable, Health, Scan, Truth, VibrationBlock

SOURCES = (ChannelTable, VibrationBlock, Scan, Truth)
BAG = BAGS / "jam"
LIMIT_S = 60.0


def player(*parameters: str) -> list[str]:
    given = [part for each in parameters for part in ("-p", each)]
    return node("flea_diag.nodes.recording.player", *given)


def test_all_that_a_stand_sent_is_played_in_its_order_and_nothing_else(domain: int) -> None:
    sent = [record for _, record in BagReader(BAG).records(SOURCES)]
    with Peer(domain) as peer:
        for kind in (*SOURCES, AmbiguityGroup):
            peer.bus.subscribe(kind, peer.records.append)
        diagnoser = node("flea_diag.nodes.diagnoser", "-p", "memory:=none")
        play = player(f"bag:={BAG}", "rate:=4.0", "wait_for:=diagnoser")
        with Process(play, domain) as process, Process(diagnoser, domain):
            peer.find(lambda r: isinstance(r, AmbiguityGroup) and r.stale, LIMIT_S)
            assert process.end() == 0, process.output
    for kind in SOURCES:
        played = [record for record in peer.records if isinstance(record, kind)]
        assert played == [record for record in sent if isinstance(record, kind)]
    assert f"{len(sent)} records played" in process.output


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
            assert "Traceback" not in process.output
