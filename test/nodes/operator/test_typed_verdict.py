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

"""The verdict as a message of flea_diag_msgs, which is built here from its files."""

from __future__ import annotations

import json
import os
import re
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import pytest
from support.live import ROOT, Peer, Process, node
from support.neighbours.message_package import built, can_build
from support.verdicts import LAST, NOMINAL

from flea_diag import __version__
from flea_diag.wire.messages.typed_verdict import TYPE, typed_verdict
from flea_diag.wire.messages.verdict_numbers import NUMBER_OF
from flea_diag.wire.records import Candidate, Level, Outcome, Recurrence, TwoFaults

PACKAGE = ROOT / "flea_diag_msgs"
NODE = "typed_verdict"
JAM = Candidate("jam", "friction+", 0.97, "fits", (), 118.5, 4.25, "N")
COMES = Recurrence(7, 10**18, 10**18 + 10**9, 1.5, 12.0, 0.1, 2.0, 0.03, "rad", 4.0, 9)
FOUND = replace(
    LAST, members=(JAM,), words="the fault is jam", looked_for=("jam", "spall"),
    pairs=(TwoFaults("jam", "spall", 0.75),), comes_and_goes=(COMES,),
)  # fmt: skip


@pytest.fixture(scope="module")
def types(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rosidl_generator_py", reason="needs the generators of ROS 2")
    if not can_build():
        pytest.skip("needs gcc, g++ and the headers of ROS 2")
    return built(PACKAGE, tmp_path_factory.mktemp("types"))


def constants() -> dict[str, int]:
    text = (PACKAGE / "msg" / "Verdict.msg").read_text(encoding="utf-8")
    return {name: int(value) for name, value in re.findall(r"^uint8 (\w+)=(\d+)$", text, re.M)}


def test_the_constants_are_the_numbers_of_the_verdict() -> None:
    told = {outcome.value: number for outcome, number in NUMBER_OF.items()}
    told |= {level.name: int(level) for level in (Level.OK, Level.WARN, Level.ERROR)}
    assert constants() == told


def test_the_package_has_the_version_of_flea_diag_and_lists_its_messages() -> None:
    root = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert root.findtext("version") == __version__
    assert root.findtext("member_of_group") == "rosidl_interface_packages"
    listed = re.findall(r'"(msg/\w+\.msg)"', (PACKAGE / "CMakeLists.txt").read_text("utf-8"))
    assert listed == [f"msg/{path.name}" for path in sorted(PACKAGE.glob("msg/*.msg"))]


def fields(message: str) -> list[str]:
    text = (PACKAGE / "msg" / f"{message}.msg").read_text(encoding="utf-8")
    return re.findall(r"^[\w/\[\]]+ +([a-z]\w*)", text, re.M)


def test_every_field_of_the_message_is_filled() -> None:
    told = typed_verdict(FOUND)
    assert list(told) == fields("Verdict")
    for name, message in (("members", "PossibleFault"), ("pairs", "TwoFaults"),
                          ("comes_and_goes", "Recurrence")):  # fmt: skip
        assert list(told[name][0]) == fields(message)


LISTENER = """
import json, rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from flea_diag_msgs.msg import Verdict

def said(told):
    stamp = told.header.stamp
    print(json.dumps({
        "outcome": told.outcome, "level": told.level, "words": told.words,
        "stamp_ns": stamp.sec * 10**9 + stamp.nanosec, "detected_s": told.detected.sec,
        "members": [
            [f.fault, f.hypothesis, f.size, f.size_sigma, f.size_unit] for f in told.members
        ],
        "dropped": [f.fault for f in told.dropped], "not_observable": told.not_observable,
        "looked_for": told.looked_for, "pairs": [[p.first, p.second] for p in told.pairs],
        "comes": [[c.count, c.most, c.place_unit] for c in told.comes_and_goes],
    }), flush=True)

rclpy.init()
node = rclpy.create_node("listener")
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(Verdict, "verdict", said, latched)
print("listening", flush=True)
rclpy.spin(node)
"""


@pytest.mark.in_turn(2)
def test_who_listens_reads_the_verdict_by_its_fields(types: Path, domain: int) -> None:
    known = os.environ.get("LD_LIBRARY_PATH", "")
    places = {"PYTHONPATH": f"{types}:{ROOT}", "LD_LIBRARY_PATH": f"{types}:{known}"}
    with (
        Peer(domain) as peer,
        Process([sys.executable, "-c", LISTENER], domain, **places) as listener,
        Process(node(NODE), domain, **places) as process,
    ):
        process.wait_for(f"as {TYPE} on verdict")
        listener.wait_for("listening")
        peer.bus.publish(FOUND.hypotheses())
        peer.bus.publish(replace(FOUND, summary=True, dropped=(), dropped_count=2))
        dropped = json.dumps([row.fault for row in FOUND.dropped])
        listener.wait_for(f'"dropped": {dropped}, ')
        found = json.loads(listener.output.splitlines()[-1])
        peer.bus.publish(NOMINAL)
        listener.wait_for('"outcome": 0')
        healthy = json.loads(listener.output.splitlines()[-1])
    assert (found["outcome"], found["level"]) == (NUMBER_OF[Outcome.ISOLATED], Level.ERROR)
    assert found["stamp_ns"] == FOUND.stamp_ns
    assert found["detected_s"] == FOUND.detected_stamp_ns // 10**9
    assert found["words"] == "the fault is jam"
    assert found["members"] == [["jam", "friction+", 118.5, 4.25, "N"]]
    assert found["not_observable"] == [fault for fault, _ in FOUND.not_observable]
    assert found["looked_for"] == ["jam", "spall"]
    assert found["pairs"] == [["jam", "spall"]]
    assert found["comes"] == [[7, 9, "rad"]]
    assert healthy["members"] == []
    assert healthy["detected_s"] == 0


def test_without_the_package_it_says_what_to_install(domain: int) -> None:
    if hasattr(sys.modules.get("flea_diag_msgs.msg"), "Verdict"):
        pytest.skip("flea_diag_msgs is installed")
    with Process(node(NODE), domain) as process:
        process.wait_for("install the package flea_diag_msgs and source it\n")
        assert process.child.wait(20.0) == 2
    assert process.output.count("\n") == 1
