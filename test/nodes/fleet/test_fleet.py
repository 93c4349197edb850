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
from support.live import LIMIT_S, ROOT, Peer, Process, node

from flea_diag.errors import ConfigurationError
from flea_diag.nodes.fleet.stand_list import StandEntry, stand_entries
from flea_diag.wire.bags.bag import BagReader
from flea_diag.wire.messages import codec
from flea_diag.wire.records import Health, Level, Scan, VibrationBlock

FLEET = [sys.executable, str(ROOT / "test" / "support" / "programs" / "faulty_fleet.py")]
POISON = 666.0
FLOOD, ROUNDS = 300, 100
"""Scans that one stand is sent for each of another, and how often."""
HEAVY = 12
"""Blocks and scans that are too large; the blocks have 240 MB together."""
MOST_MB = 150.0
"""By which the process may grow meanwhile: one block on its way through middleware and budget, in a
few copies. Where blocks were kept, or judged, they would take more than all of them have."""


def scans(count: int) -> list[Scan]:
    """The first scans of a recording, without a fault."""
    records = BagReader(BAGS / "jam").records((Scan,))
    return [record for (_, record), _ in zip(records, range(count), strict=False)]


def block(number: int) -> bytes:
    """A block of vibration of 20 MB."""
    stamp_ns = 10**18 + number * 10**9
    return codec.encode(VibrationBlock(stamp_ns, ("a",), 2_500_000, bytes(20_000_000)))


def wide(number: int) -> bytes:
    """A scan of ten thousand channels."""
    names = tuple(f"channel_{number}" for number in range(10_000))
    return codec.encode(Scan(10**18 + number, names, (0.0,) * len(names)))


def resident_mb(pid: int) -> float:
    """Most memory that a process has had, MB."""
    lines = Path(f"/proc/{pid}/status").read_text("ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1e3


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

    def counted(self, name: str, counter: str, topic: str = "sensors/slow") -> int:
        """Counter of a topic in the latest health of a stand's diagnoser."""
        told = self.health.get(f"{name}/diagnoser")
        return int(dict(told.values).get(f"{topic}/{counter}", 0)) if told else 0

    def send_block(self, name: str, data: bytes) -> None:
        """Send a block of vibration."""
        from rclpy.duration import Duration
        from sensor_msgs.msg import PointCloud2

        topic = f"/{name}/sensors/vibration"
        if topic not in self._out:
            self._out[topic] = self.peer.node.create_publisher(PointCloud2, topic, 50)
            self.peer.until(lambda: bool(self._out[topic].get_subscription_count()))
        self._out[topic].publish(data)
        # What the queues of the middleware hold is not the fleet's: one at a time.
        assert self._out[topic].wait_for_all_acked(Duration(seconds=int(LIMIT_S)))

    def connected(self) -> None:
        self.peer.until(lambda: all(out.get_subscription_count() for out in self._out.values()))

    def send(self, name: str, *sent: bytes) -> None:
        for data in sent:
            self._out[name].publish(data)


@pytest.fixture
def fleet(domain: int, tmp_path: Path) -> Iterator[Fleet]:
    broken = tmp_path / "broken.yaml"
    broken.write_text("nonsense: 1\n", encoding="utf-8")
    stands = ["sound", f"broken=flea@{broken}", "failing", "flooded", "heavy"]
    command = [*FLEET, "--ros-args", "-p", f"stands:={stands}"]
    with Process(command, domain) as process, Peer(domain) as peer:
        made = Fleet(peer, ("sound", "failing", "flooded", "heavy"))
        made.process = process  # type: ignore[attr-defined]
        peer.until(lambda: "4 of 5 stands running" in made.said())
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
    peer.until(lambda: "3 of 5 stands running" in fleet.said())
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

    # One sends what takes memory and time: its budget refuses that by name.
    before_mb = resident_mb(fleet.process.child.pid)  # type: ignore[attr-defined]
    fleet.send_block("heavy", block(0))
    fleet.process.wait_for(  # type: ignore[attr-defined]
        "a message of 20.0 MB is lost: with it more than the 16 MB of this stand would wait"
    )
    for number in range(HEAVY):
        fleet.send_block("heavy", block(1 + number))
        fleet.send("heavy", wide(number))
        fleet.send("sound", sent[ROUNDS + number])
        # What came before it has been taken off the wire.
        peer.until(lambda number=number: fleet.answered["sound"] == ROUNDS + 1 + number)
    peer.until(lambda: fleet.counted("heavy", "lost", "sensors/vibration") == 1 + HEAVY)
    peer.until(lambda: fleet.counted("heavy", "malformed") == HEAVY)
    assert fleet.counted("sound", "lost") == 0
    assert resident_mb(fleet.process.child.pid) - before_mb < MOST_MB  # type: ignore[attr-defined]
    # It is given back: a sound scan of the same stand is judged.
    fleet.send("heavy", sent[0])
    peer.until(lambda: fleet.answered["heavy"] == 1)

    # The one that failed is configured again through its life cycle.
    assert peer.change_state("failing/diagnoser", "configure")
    assert peer.change_state("failing/diagnoser", "activate")
    peer.until(lambda: "4 of 5 stands running" in fleet.said())
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
    with Process(node("fleet", "-p", stands), domain) as process:
        assert process.end() == 2
    last = process.output.splitlines()[-1]
    assert last.startswith("flea_diag: no stand can be built; the first: ")
    assert "./nowhere" in last
