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

"""What is shipped to keep a stand to itself: the loopback profile at work, the policies whole."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from support.live import ROOT, Process, node

from flea_diag.configuration.files import config_path
from flea_diag.nodes.executables import program_of
from flea_diag.nodes.run.live_run import discovery
from flea_diag.wire.messages.typed_verdict import VERDICT
from flea_diag.wire.topics import TOPICS

PROFILE = config_path("security/loopback.xml")
POLICY = config_path("security/policy.xml")
LOOPBACK = "127.0.0.1"
NO_PROFILE = {"FASTRTPS_DEFAULT_PROFILES_FILE": ""}
DEFAULT = {"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}
NODES = sorted(path.name for path in (ROOT / "launcher").iterdir() if not path.suffix)


def udp_addresses(pid: int) -> set[str]:
    """Addresses that the UDP sockets of a process are bound to, as the kernel has them."""
    links = (path.readlink() for path in Path(f"/proc/{pid}/fd").iterdir() if path.is_symlink())
    inodes = {link.name[8:-1] for link in links if link.name.startswith("socket:[")}
    rows = [line.split() for line in Path(f"/proc/{pid}/net/udp").read_text().splitlines()[1:]]
    raw = (bytes.fromhex(row[1].partition(":")[0])[::-1] for row in rows if row[9] in inodes)
    return {".".join(map(str, address)) for address in raw}


def segments(pid: int) -> set[str]:
    """Segments of shared memory that Fast DDS has made for a process or opened of others."""
    maps = Path(f"/proc/{pid}/maps").read_text(encoding="utf-8", errors="replace")
    return {word for word in maps.split() if word.startswith("/dev/shm/fastrtps")}


@pytest.mark.parametrize(("transports", "shared"), [({}, False), (DEFAULT, True)])
def test_no_node_shares_memory_unless_it_is_asked_to(
    domain: int, transports: dict[str, str], shared: bool
) -> None:
    """A reader that is killed may spoil that memory for all who are left."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    console = node("console", "-p", "style:=lines")
    alone = {**NO_PROFILE, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", **transports}
    with Process(console, domain, **alone) as process:
        process.wait_for("no verdict yet")
        assert bool(segments(process.child.pid)) == shared


def test_with_the_profile_every_socket_is_on_loopback_and_the_verdict_arrives(domain: int) -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    profile = discovery()
    assert profile["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(PROFILE)
    without = {**NO_PROFILE, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    console = node("console", "-p", "style:=lines")
    daq = node("daq", "-p", "duration_s:=30.0", "-p", "wait_for_subscribers:=1")
    with (
        Process(console, domain, **profile) as screen,
        Process(node("diagnoser"), domain, **profile) as diagnoser,
        Process(daq, domain, **profile) as stand,
        Process(console, domain, **without) as outside,
    ):
        screen.wait_for("NOMINAL")
        for process in (screen, diagnoser, stand):
            assert udp_addresses(process.child.pid) == {LOOPBACK}
            assert not segments(process.child.pid)
        # Who has no such profile is still told, on this machine.
        outside.wait_for("NOMINAL")
        assert LOOPBACK not in udp_addresses(outside.child.pid)


def profiles() -> dict[str, ET.Element]:
    """Profile of each node in the policies; a file of ours, hence parsed as it is."""
    root = ET.parse(POLICY).getroot()
    return {each.attrib["node"]: each for each in root.iter("profile")}


OF_ALL = {"~/state", "~/transition_event"}
"""Topics that each node publishes as a managed one."""
WAITED_FOR = {
    f"{name}/state" for name in ("diagnoser", "observer", "isolator", "extractor", "recorder")
}
WAITING = ("daq", "player")
SOURCES = (*WAITING, "bridge")
LIFE_CYCLE = (
    "change_state", "get_state", "get_available_states", "get_available_transitions",
    "get_transition_graph",
)  # fmt: skip


def named(profile: ET.Element, kind: str) -> set[str]:
    """Topics that a profile may publish or subscribe."""
    return {t.text or "" for rule in profile.findall(f"topics[@{kind}]") for t in rule}


def test_every_node_has_a_policy_and_every_topic_in_it_is_ours() -> None:
    known = {topic.name for topic in TOPICS} | OF_ALL | WAITED_FOR | {VERDICT}
    standard = {"/parameter_events", "/rosout", "/clock"}
    assert sorted(profiles()) == NODES
    for name, profile in profiles().items():
        assert named(profile, "publish") | named(profile, "subscribe") <= known | standard, name


def test_the_policies_allow_what_each_node_declares_and_no_more() -> None:

    for name, profile in profiles().items():
        declared = program_of(name)
        topics = {topic.record: topic.name for topic in TOPICS}
        standard = {"/parameter_events", "/rosout", "/clock"}
        writes = {topics[t] for t in declared.publishes} | OF_ALL
        writes |= {VERDICT} if name == "typed_verdict" else set()
        reads = {topics[t] for t in declared.subscribes}
        reads |= WAITED_FOR if name in WAITING else set()
        assert named(profile, "publish") - standard == writes
        assert named(profile, "subscribe") - standard == reads


def test_the_policies_allow_the_life_cycle_of_each_node() -> None:
    wanted = {f"~/{name}" for name in LIFE_CYCLE}
    for name, profile in profiles().items():
        replies = {s.text or "" for rule in profile.findall("services[@reply]") for s in rule}
        assert wanted <= replies, name


def test_only_the_stand_says_what_the_sensors_read() -> None:
    for name, profile in profiles().items():
        writes = {topic for topic in named(profile, "publish") if topic.startswith("sensors/")}
        assert bool(writes) == (name in SOURCES)
