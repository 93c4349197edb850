"""Several stands in one process: what happens to one does not reach the others."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.decisions import BAGS
from support.live import ROOT, Peer, Process, node

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.fleet.stand_list import StandEntry, stand_entries
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health, Level, Scan

FLEET = [sys.executable, str(ROOT / "test" / "support" / "programs" / "faulty_fleet.py")]
POISON = 666.0
FLOOD, ROUNDS = 300, 100
"""Scans that one stand is sent for each of another, and how often."""


def scans(count: int) -> list[Scan]:
    """The first scans of a recording, without a fault."""
    records = BagReader(BAGS / "jam").records((Scan,))
    return [record for (_, record), _ in zip(records, range(count), strict=False)]


class Fleet:
    """What the fleet says, and the scans that its stands are sent and answer."""

    def __init__(self, peer: Peer, namespaces: tuple[str, ...]) -> None:
        from sensor_msgs.msg import JointState

        self.peer, self.health = peer, {}
        self.answered: Counter[str] = Counter()
        self._out = {
            name: peer.node.create_publisher(JointState, f"/{name}/sensors/slow", 100)
            for name in namespaces
        }
        for name in namespaces:
            peer.node.create_subscription(
                JointState, f"/{name}/residual", lambda _, name=name: self.answered.update([name]),
                1000, raw=True,
            )  # fmt: skip
        peer.bus.subscribe(Health, lambda record: self.health.update({record.node: record}))

    def said(self, name: str = "fleet") -> str:
        """Latest words of a node on its health."""
        return self.health[name].message if name in self.health else ""

    def counted(self, name: str, counter: str) -> int:
        """Counter of the scans in the latest health of a stand's diagnoser."""
        told = self.health.get(f"{name}/diagnoser")
        return int(dict(told.values).get(f"sensors/slow/{counter}", 0)) if told else 0

    def connected(self) -> None:
        self.peer.until(lambda: all(out.get_subscription_count() for out in self._out.values()))

    def send(self, name: str, *sent: bytes) -> None:
        for data in sent:
            self._out[name].publish(data)


@pytest.fixture
def fleet(domain: int, tmp_path: Path) -> Iterator[Fleet]:
    broken = tmp_path / "broken.yaml"
    broken.write_text("nonsense: 1\n", encoding="utf-8")
    stands = ["sound", f"broken=flea@{broken}", "failing", "flooded"]
    command = [*FLEET, "--ros-args", "-p", f"stands:={stands}"]
    with Process(command, domain) as process, Peer(domain) as peer:
        made = Fleet(peer, ("sound", "failing", "flooded"))
        made.process = process  # type: ignore[attr-defined]
        peer.until(lambda: "3 of 4 stands running" in made.said())
        made.connected()
        yield made


def test_what_happens_to_one_stand_does_not_reach_the_others(fleet: Fleet) -> None:
    peer, read = fleet.peer, scans(FLOOD)
    sent = list(map(codec.encode, read))
    # One cannot be built: it is named, with the file and the reason.
    assert fleet.health["fleet"].level is Level.ERROR
    assert "not: broken (" in fleet.said()
    assert "broken.yaml: calibration has no schema_version" in fleet.said()
    assert fleet.said("broken/diagnoser").startswith("unconfigured")
    log = fleet.process.wait_for("stand broken is left out: ")  # type: ignore[attr-defined]
    assert log.count("is left out") == 1

    # One fails at a scan: it is set aside, and its last words say why.
    fleet.send("failing", *sent[:20])
    peer.until(lambda: fleet.answered["failing"] == 20)
    poisoned = replace(read[20], values=(POISON, *read[20].values[1:]))
    fleet.send("failing", codec.encode(poisoned))
    peer.until(lambda: "2 of 4 stands running" in fleet.said())
    assert "failing (ZeroDivisionError in faulty_fleet.py:" in fleet.said()
    peer.until(lambda: fleet.said("failing/diagnoser").startswith("unconfigured"))

    # One is flooded: it loses scans of its own, and the other none.
    for number in range(ROUNDS):
        fleet.send("flooded", *sent)
        fleet.send("sound", sent[number])
    peer.until(lambda: fleet.answered["sound"] == ROUNDS)
    peer.until(lambda: fleet.counted("flooded", "lost") > 0)
    peer.until(lambda: fleet.counted("sound", "received") == ROUNDS)
    assert fleet.counted("sound", "lost") == 0

    # The one that failed is configured again through its life cycle.
    assert peer.change_state("failing/diagnoser", "configure")
    assert peer.change_state("failing/diagnoser", "activate")
    peer.until(lambda: "3 of 4 stands running" in fleet.said())
    fleet.connected()
    fleet.send("failing", *sent[21:40])
    peer.until(lambda: fleet.answered["failing"] >= 39)


def test_the_list_of_stands_is_read() -> None:
    entries = stand_entries(("bay_1", "hall/bay_2=./mine", "/bay_3=ema@./c.yaml", "bay_4=@x"))
    assert entries == (
        StandEntry("bay_1", "flea", ""),
        StandEntry("hall/bay_2", "./mine", ""),
        StandEntry("bay_3", "ema", "./c.yaml"),
        StandEntry("bay_4", "flea", "x"),
    )


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ((), "stands = [] names no stand"),
        (("bay_1", "bay_1=ema"), "the namespace 'bay_1' occurs twice"),
        (("bay 1",), "'bay 1' is no NAMESPACE"),
        (("=./mine",), "'=./mine' is no NAMESPACE"),
        (("1st",), "begins with a letter"),
        (tuple(f"bay_{number}" for number in range(257)), "257 entries, at most 256"),
    ],
)
def test_a_list_that_cannot_be_read_is_refused(texts: tuple[str, ...], words: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        stand_entries(texts)


def test_a_fleet_of_which_no_stand_can_be_built_ends(domain: int, tmp_path: Path) -> None:
    stands = f"stands:=['one=./nowhere', 'two=flea@{tmp_path / 'none.yaml'}']"
    with Process(node("flea_diag.nodes.fleet.fleet", "-p", stands), domain) as process:
        assert process.end() == 2
    last = process.output.splitlines()[-1]
    assert last.startswith("flea_diag: no stand can be built; the first: ")
    assert "./nowhere" in last
