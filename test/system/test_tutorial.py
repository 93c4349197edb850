"""The tutorial as it stands: its commands are taken from the page and run, in their order."""

from __future__ import annotations

import copy
import json
import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from support.live import Peer, Process, node
from support.places import ROOT

from flea_diag.tools.main import main
from flea_diag.wire.records import AmbiguityGroup, Outcome, Residual

PAGE = ROOT / "docs" / "tutorial_joint.md"
BLOCK = re.compile(r'^```(\w+) title="([^"]+)"\n(.*?)^```', re.MULTILINE | re.DOTALL)
BLOCKS = {found[2]: found[3] for found in BLOCK.finditer(PAGE.read_text(encoding="utf-8"))}
GROUP = {"gear_friction", "jam"}
ALIKE = {"magnet_loss", "motor_current_scaling"}
"""Less torque for each ampere, which a drag looks like at first."""
MOST_COMMANDS = 4
EDITED = "tutorial/elbow/channels.yaml"
LIMIT_S = 60.0
BATCH = 50
ATTEMPTS = 30


def commands(title: str) -> list[list[str]]:
    """Commands of one block, with the files that their patterns stand for."""
    return [
        [name for word in shlex.split(line) for name in matching(word)]
        for line in BLOCKS[title].splitlines()
    ]


def matching(word: str) -> list[str]:
    return sorted(map(str, Path().glob(word))) if "*" in word else [word]


def run(title: str) -> None:
    """Run a block, each command in this process."""
    for line in BLOCKS[title].splitlines():
        (program, *arguments) = (name for w in shlex.split(line) for name in matching(w))
        if program == "python":
            script, *rest = arguments
            sys.argv = [script, *rest]
            runpy.run_path(str(ROOT / script), run_name="__main__")
        else:
            assert program == "flea"
            assert main(arguments) == 0, line


def edit(name: str) -> None:
    """Put the lines of the page into the file."""
    path = Path(name)
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    merge(content, yaml.safe_load(BLOCKS[f"edit {name}"]))
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def merge(content: dict[str, Any], more: dict[str, Any]) -> None:
    for key, value in more.items():
        if isinstance(value, dict):
            merge(content[key], value)
        else:
            content[key] = value


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder in which everything of the page but the live part and the table was done."""
    place = tmp_path_factory.mktemp("tutorial")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.setattr(sys, "argv", sys.argv)
        run("recordings")
        run("stand")
        edit(EDITED)
        run("verdict")
        yield place / "tutorial"


def verdict(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def test_a_bag_of_a_robot_leads_to_a_verdict(folder: Path) -> None:
    told = verdict(folder / "verdict.json")
    assert told["outcome"] == "INDISTINGUISHABLE"
    assert set(told["ambiguity_group"]) == GROUP
    assert 12.0 < told["detected_at_s"] < 14.0
    assert "\nINDISTINGUISHABLE: one of gear_friction, jam: not isolable" in PAGE.read_text("utf-8")


def test_it_takes_four_commands_and_one_file() -> None:
    assert len(commands("stand")) + len(commands("verdict")) <= MOST_COMMANDS
    assert [title for title in BLOCKS if title.startswith("edit")] == [f"edit {EDITED}"]


def test_the_page_of_the_recordings_is_printed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("check")
    told = capsys.readouterr().out
    assert told.startswith("Stand elbow: 4 recordings, 120 s")
    assert "motor_voltage: " in told


def test_a_table_leads_to_the_same_verdict(folder: Path) -> None:
    run("csv")
    told, of_bag = verdict(folder / "table_verdict.json"), verdict(folder / "verdict.json")
    assert set(told["ambiguity_group"]) == GROUP
    assert told["detected_at_s"] == pytest.approx(of_bag["detected_at_s"], abs=0.1)


def test_the_verdict_comes_live_on_ambiguity_group(folder: Path, domain: int) -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    bridge, diagnoser, echo = commands("live")
    assert echo == ["ros2", "topic", "echo", "/ambiguity_group"]
    assert bridge[:3] == diagnoser[:3] == ["ros2", "run", "flea_diag"][:3]
    reliable = "qos_overrides./joint_states.subscription.reliability:=reliable"
    given = [*bridge[5:], "-p", reliable]
    with (
        Process(node("flea_diag.nodes.bridge", *given), domain, cwd=folder.parent),
        Process(
            node("flea_diag.nodes.diagnoser", *diagnoser[5:], "-p", "memory:=none"),
            domain,
            cwd=folder.parent,
        ),
        Peer(domain) as peer,
    ):
        peer.listen(AmbiguityGroup, Residual)
        play(peer, folder / "recordings" / "sticky")
        found = peer.find(lambda r: isinstance(r, AmbiguityGroup) and is_final(r), LIMIT_S)
    # The first group; it may shrink with the motion to come.
    assert GROUP <= {member.fault for member in found.members} <= GROUP | ALIKE


def is_final(record: AmbiguityGroup) -> bool:
    return bool(record.members) and record.outcome is not Outcome.DETECTED


def play(peer: Peer, bag: Path) -> None:
    """Send a recording faster than real time, no faster than the diagnosis follows.

    It begins anew, later, until the diagnosis answers: a writer may not know its reader yet.
    """
    writers, messages = publishers(peer), list(recorded(bag))
    peer.until(lambda: all(w.get_subscription_count() for w in writers.values()), LIMIT_S)
    for later_s in range(0, 2 * ATTEMPTS, 2):
        for topic, message in messages[:BATCH]:
            writers[topic].publish(moved(message, later_s))
        if peer.bus.wait_until(lambda: newest_ns(peer) > 0, 1.0):
            break
    assert newest_ns(peer) > 0
    for number, (topic, message) in enumerate(messages[BATCH:], 1):
        sent = moved(message, later_s)
        writers[topic].publish(sent)
        if number % BATCH == 0:
            stamp_ns = sent.header.stamp.sec * 10**9 + sent.header.stamp.nanosec
            peer.until(lambda least=stamp_ns - 500_000_000: newest_ns(peer) >= least, LIMIT_S)


def publishers(peer: Peer) -> dict[str, Any]:
    from sensor_msgs.msg import JointState, Temperature

    kinds = {"/joint_states": JointState, "/elbow/temperature": Temperature}
    return {topic: peer.node.create_publisher(kind, topic, 100) for topic, kind in kinds.items()}


def recorded(bag: Path) -> Iterator[tuple[str, Any]]:
    """Topic and message of everything in a bag."""
    from rclpy.serialization import deserialize_message
    from rosbags.rosbag2 import Reader
    from sensor_msgs.msg import JointState, Temperature

    kinds = {"/joint_states": JointState, "/elbow/temperature": Temperature}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            yield connection.topic, deserialize_message(data, kinds[connection.topic])


def moved(message: Any, later_s: int) -> Any:
    """The same message so much later."""
    made = copy.deepcopy(message)
    made.header.stamp.sec += later_s
    return made


def newest_ns(peer: Peer) -> int:
    """Stamp of the newest residual; 0: none."""
    found = (r.stamp_ns for r in reversed(peer.records) if isinstance(r, Residual))
    return next(found, 0)
