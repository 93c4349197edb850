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

"""The tutorial as it stands: its commands are taken from the page and run, in their order."""

from __future__ import annotations

import copy
import json
import math
import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from support.live import Peer, Process, node
from support.places import ROOT

from flea_diag.configuration.stand import load_stand
from flea_diag.stages.digest import decided
from flea_diag.tools.main import main
from flea_diag.tools.replay.recorded import completed
from flea_diag.tools.replay.replay import diagnosis
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    Detection,
    Hypotheses,
    Residual,
    Scan,
    Symbols,
)
from flea_diag.wire.sources.scan_grid import LEAPS

PAGE = ROOT / "docs" / "tutorial_joint.md"
BLOCK = re.compile(r'^```(\w+) title="([^"]+)"\n(.*?)^```', re.MULTILINE | re.DOTALL)
BLOCKS = {found[2]: found[3] for found in BLOCK.finditer(PAGE.read_text(encoding="utf-8"))}
GROUP = {"gear_friction", "jam"}
MOST_COMMANDS = 4
EDITED = "tutorial/elbow/channels.yaml"
LIMIT_S = 60.0
BATCH = 50
ATTEMPTS = 30
LATER_S = 1000
"""What finds out whether all are connected is stamped so much later than the recording."""
COMPARED_NS = 27 * 10**9
"""Decisions of the first 27 of 30 s are compared."""


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


@pytest.fixture(scope="module")
def tables(folder: Path) -> Path:
    """The same folder, with the part of the page on tables done."""
    run("csv")
    return folder


def test_a_table_leads_to_the_same_verdict(tables: Path) -> None:
    told, of_bag = verdict(tables / "table_verdict.json"), verdict(tables / "verdict.json")
    assert set(told["ambiguity_group"]) == GROUP
    assert told["detected_at_s"] == pytest.approx(of_bag["detected_at_s"], abs=0.1)


def test_degrees_rpm_and_turned_signs_give_the_same_scans(tables: Path) -> None:
    """Another make: names, units, signs, separator, and a thermometer that is silent for 1.3 s."""
    time, current, velocity, angle, warm = np.loadtxt(
        tables / "tables" / "healthy_1.csv", delimiter=",", skiprows=1
    ).T
    fahrenheit = 1.8 * warm + 32.0
    fahrenheit[1200:1330] = np.nan
    other, head = tables / "other.csv", "t_ms;arm current mA;arm velocity rpm;arm angle deg;arm F"
    columns = (1e3 * (time - time[0]), -1e3 * current, velocity * 30.0 / np.pi, -np.degrees(angle))
    table = np.column_stack([*columns, fahrenheit])
    np.savetxt(other, table, delimiter=";", header=head, comments="", fmt="%.12g")
    stand, bags = str(tables / "other"), tables / "other_bags"
    assert main(["stand", "new", stand, "--from", str(other)]) == 0
    assert main(["import", "--stand", stand, str(other), "-o", str(bags)]) == 0
    expected, found = values(tables / "table_bags" / "healthy_1"), values(bags / "other")
    assert np.isnan(found[1200:1329, 3]).all()
    found[1198:1332, 3] = expected[1198:1332, 3]
    # The times of both tables are rounded to 0.1 us.
    np.testing.assert_allclose(found[:2900], expected[:2900], rtol=1e-5, atol=1e-4)


def values(bag: Path) -> npt.NDArray[np.float64]:
    """Readings of all scans, shape (scans, channels)."""
    return np.array([scan.values for _, scan in read_bag(bag, (Scan,)) if isinstance(scan, Scan)])


@pytest.mark.in_turn(2)
def test_the_bridge_leads_to_the_decisions_of_the_import(folder: Path, domain: int) -> None:
    """Detection, symbols and the verdict on /ambiguity_group are those of the replayed import."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    bridge, diagnoser, echo = commands("live")
    assert echo == ["ros2", "topic", "echo", "/ambiguity_group"]
    assert bridge[:3] == diagnoser[:3] == ["ros2", "run", "flea_diag"][:3]
    reliable = "qos_overrides./joint_states.subscription.reliability:=reliable"
    given = [*bridge[5:], "-p", reliable]
    with (
        Process(node("bridge", *given), domain, cwd=folder.parent),
        Process(
            node("diagnoser", *diagnoser[5:], "-p", "memory:=none"),
            domain,
            cwd=folder.parent,
        ),
        Peer(domain) as peer,
    ):
        peer.listen(ChannelTable, Residual, Detection, Symbols, Hypotheses, AmbiguityGroup)
        play(peer, folder / "recordings" / "sticky")
        live = decisions(peer.records)
    expected = decisions(replayed(folder))
    assert live == expected
    assert {member["fault"] for member in json.loads(live[-1])["members"]} == GROUP


def replayed(folder: Path) -> list[Any]:
    """Records of the diagnosis of the imported recording."""
    bag, stand = folder / "bags" / "sticky", load_stand(folder / "elbow")
    return list(diagnosis(bag, stand, (Detection, Symbols, AmbiguityGroup)))


def decisions(records: list[Any]) -> list[str]:
    """Detections, symbols and the last group, a line each, without those near the end.

    An import ends with the last reading; live, a scan waits for the reading after it. Of groups
    that follow each other at once, the topic keeps the last.
    """
    begin_ns = [r.stamp_ns for r in records if isinstance(r, ChannelTable)][-1]
    kinds = (Detection, Symbols, AmbiguityGroup)
    detections, symbols, groups = (
        [r for r in records if isinstance(r, kind) and r.stamp_ns <= begin_ns + COMPARED_NS]
        for kind in kinds
    )
    hypotheses = [record for record in records if isinstance(record, Hypotheses)]
    return [decided(each) for each in completed([*detections, *symbols, *hypotheses, groups[-1]])]


def play(peer: Peer, bag: Path) -> None:
    """Send a recording faster than real time, no faster than the diagnosis follows.

    First its beginning, stamped as if it were recorded later, until the diagnosis answers: a writer
    may not know its reader yet. Then stamps go back, as in a bag that is played in a loop: the
    bridge begins a new stream with the tenth message, and the diagnosis begins anew with it.
    """
    writers, messages = publishers(peer), list(recorded(bag))
    peer.until(lambda: all(w.get_subscription_count() for w in writers.values()), LIMIT_S)
    for later_s in range(LATER_S, LATER_S + 2 * ATTEMPTS, 2):
        for topic, message in messages[:BATCH]:
            writers[topic].publish(moved(message, later_s))
        if peer.bus.wait_until(lambda: newest_ns(peer) > 0, 1.0):
            break
    assert newest_ns(peer) > 0
    topic, first = messages[0]
    begin_ns = stamp_ns(first)
    end_ns = begin_ns + LATER_S * 10**9
    for _ in range(LEAPS):
        writers[topic].publish(first)
    peer.until(lambda: begins(peer) == begin_ns, LIMIT_S)
    del peer.records[: latest_table(peer)]
    for number, (topic, message) in enumerate(messages[1:], 1):
        writers[topic].publish(message)
        if number % BATCH == 0:
            least_ns = stamp_ns(message) - 500_000_000
            peer.until(lambda least=least_ns: newest_ns(peer, end_ns) >= least, LIMIT_S)
    said = sum(isinstance(record, AmbiguityGroup) for record in peer.records)
    # A verdict is repeated each second, so the second one is later than all of these messages.
    peer.until(
        lambda: sum(isinstance(record, AmbiguityGroup) for record in peer.records) >= said + 2,
        LIMIT_S,
    )


def latest_table(peer: Peer) -> int:
    """Place of the latest channel table; -1: none."""
    places = (k for k, r in enumerate(peer.records) if isinstance(r, ChannelTable))
    return max(places, default=-1)


def begins(peer: Peer) -> int:
    """Stamp of the latest channel table, with which a stream begins."""
    place = latest_table(peer)
    return peer.records[place].stamp_ns if place >= 0 else 0


def stamp_ns(message: Any) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


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


def newest_ns(peer: Peer, before_ns: float = math.inf) -> int:
    """Stamp of the newest residual before that time; 0: none."""
    found = (r.stamp_ns for r in reversed(peer.records) if isinstance(r, Residual))
    return next((at for at in found if at < before_ns), 0)
