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

"""The heartbeat to a manager of life cycles, read by a node with the message of its fields."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from support.live import ROOT, Peer, Process, toy
from support.neighbours.message_package import built, can_build

MANAGER = """
import json, rclpy
from bond.msg import Status

def said(told):
    print(json.dumps({
        "id": told.id, "instance": told.instance_id, "active": told.active,
        "period": round(told.heartbeat_period, 3),
    }), flush=True)

rclpy.init()
node = rclpy.create_node("manager")
node.create_subscription(Status, "bond", said, 100)
print("listening", flush=True)
rclpy.spin(node)
"""


@pytest.fixture(scope="module")
def types(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rosidl_generator_py", reason="needs the generators of ROS 2")
    if not can_build():
        pytest.skip("needs gcc, g++ and the headers of ROS 2")
    package = ROOT / "test" / "support" / "neighbours" / "packages" / "bond"
    return built(package, tmp_path_factory.mktemp("types"))


def beats(manager: Process) -> list[dict[str, Any]]:
    manager.read()
    lines = [line for line in manager.output.splitlines() if line.endswith("}")]
    return [json.loads(line) for line in lines if line.startswith("{")]


def test_a_manager_hears_the_node_while_it_is_active(types: Path, domain: int) -> None:
    known = os.environ.get("LD_LIBRARY_PATH", "")
    places = {"PYTHONPATH": f"{types}:{ROOT}", "LD_LIBRARY_PATH": f"{types}:{known}"}
    bonded = toy("-p", "bond_heartbeat_period:=0.1", "-p", "autostart:=false")
    with (
        Process([sys.executable, "-c", MANAGER], domain, **places) as manager,
        Process(bonded, domain, **places),
        Peer(domain) as peer,
    ):
        manager.wait_for("listening")
        assert peer.change_state("toy", "configure")
        assert not beats(manager)
        assert peer.change_state("toy", "activate")
        peer.until(lambda: len(beats(manager)) > 3)
        assert peer.change_state("toy", "deactivate")
        peer.until(lambda: not beats(manager)[-1]["active"])
        first = beats(manager)
        assert peer.change_state("toy", "activate")
        peer.until(lambda: beats(manager)[-1]["active"])
        again = beats(manager)[len(first) :]
    assert {each["id"] for each in first} == {"toy"}
    assert {each["period"] for each in first} == {0.1}
    assert len({each["instance"] for each in first}) == 1
    assert [each["active"] for each in first] == [True] * (len(first) - 1) + [False]
    assert again[0]["instance"] not in {each["instance"] for each in first}


def test_without_the_package_the_node_says_what_to_install(domain: int) -> None:
    with Process(toy("-p", "bond_heartbeat_period:=0.1"), domain) as process:
        process.wait_for("install the package bond and source it\n")
        assert process.child.wait(20.0) == 2
    assert process.output.count("\n") == 1
