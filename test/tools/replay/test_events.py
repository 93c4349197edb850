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

"""Episodes as events of a type that viewers list, read by another library than the writer's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.live import ROOT

from flea_diag.tools.main import main as flea
from flea_diag.wire.messages.log import encode_log
from flea_diag.wire.records import Level

LIVE = ROOT / "bags" / "live_motor_current_bias"


def read(bag: Path) -> list[tuple[int, Any]]:
    """Times and messages of the one topic."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        (topic,) = reader.connections
        assert (topic.topic, topic.msgtype) == ("/episodes", "rcl_interfaces/msg/Log")
        return [(at, reader.deserialize(raw, topic.msgtype)) for _, at, raw in reader.messages()]


def test_the_course_of_a_recorded_episode(tmp_path: Path) -> None:
    target = tmp_path / "events"
    assert flea(["events", str(LIVE), "-o", str(target)]) == 0
    found = read(target)
    told = [(message.level, message.name, message.msg.partition(":")[0]) for _, message in found]
    assert told == [
        (30, "ambiguity_group", "NOT_OBSERVABLE"),
        (20, "ambiguity_group", "NOMINAL"),
        (30, "fault_detected", "WARN"),
        (30, "ambiguity_group", "DETECTED"),
        (30, "ambiguity_group", "DETECTED"),
        (30, "ambiguity_group", "DETECTED"),
        (40, "ambiguity_group", "INDISTINGUISHABLE"),
        (40, "ambiguity_group", "ISOLATED"),
    ]
    for at, message in found:
        assert message.stamp.sec * 10**9 + message.stamp.nanosec == at
    assert "one of 23 faults" in found[3][1].msg


def test_a_bag_without_a_diagnosis_is_diagnosed(tmp_path: Path) -> None:
    target = tmp_path / "events"
    assert flea(["events", str(ROOT / "bags" / "winding_short"), "-o", str(target)]) == 0
    assert read(target)[-1][1].msg.startswith("ISOLATED: the fault is winding_short")


def test_a_bag_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "metadata.yaml").write_text("somebody's\n")
    assert flea(["events", str(LIVE), "-o", str(tmp_path)]) == 2
    assert f"{tmp_path} exists: choose another with -o" in capsys.readouterr().err


def test_an_event_as_rclpy_sees_it() -> None:
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    from rcl_interfaces.msg import Log

    data = encode_log(1_283_500_000_123_456_789, Level.ERROR, "ambiguity_group", "ISOLATED: jam")
    log = serialization.deserialize_message(data, Log)
    assert (log.stamp.sec, log.stamp.nanosec) == (1_283_500_000, 123_456_789)
    assert (log.level, log.name, log.msg) == (40, "ambiguity_group", "ISOLATED: jam")
    assert (log.file, log.function, log.line) == ("", "", 0)
