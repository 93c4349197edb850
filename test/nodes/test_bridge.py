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

"""The bridge through real rclpy: a joint's topics become the scans that an import makes of them."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.foreign import arm
from support.live import Process, node
from support.neighbours.bridged import bridged

from flea_diag.tools.main import main
from flea_diag.wire.bags.bag import read_bag
from flea_diag.wire.records import Scan, VibrationBlock
from flea_diag.wire.sources.field_path import FieldPath

pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")

START_NS = 1_600_000_000 * 10**9
COUNT = 60
WARM = "/motor/temperature"
CHANNELS = {
    **{name: arm.CHANNELS[name] for name in ("motor_current", "motor_speed", "actuator_position")},
    "motor_temperature": {
        "topic": WARM, "type": arm.TEMPERATURE, "field": "temperature",
        "unit": "degF", "range": [-40.0, 200.0], "rate_hz": 3.0, "resample": "hold",
    },
}  # fmt: skip
IMU = "/motor/imu"
ACCELEROMETERS = {
    "accelerometer_1": {
        "topic": IMU, "type": "sensor_msgs/msg/Imu", "unit": "g", "range": [-500.0, 500.0],
        "rate_hz": 100.0, "axes": {"x": "linear_acceleration.x", "z": "linear_acceleration.z"},
    },
}  # fmt: skip
MAPPING = {
    "schema_version": 1, "rate_hz": 100.0, "channels": CHANNELS, "accelerometers": ACCELEROMETERS,
}  # fmt: skip


def sent() -> list[tuple[str, int, Any]]:
    """A JointState every 10 ms and a Temperature every 300 ms, 3 ms later."""
    found = []
    for k in range(COUNT):
        stamp_ns = START_NS + k * 10_000_000
        row = ["shoulder", "elbow"], [0.0, 40.0 + 0.1 * k], [0.0, 3.0 * k], [0.0, -7.0 * k]
        found.append((arm.STATES, stamp_ns, arm.joint_state(arm.header_at(stamp_ns), *row)))
        found.append((IMU, stamp_ns, imu(stamp_ns, 0.25 * k)))
        if k % 30 == 0:
            later_ns = stamp_ns + 3_000_000
            warm = arm.T[arm.TEMPERATURE](arm.header_at(later_ns), 70.0 + 0.01 * k, 0.0)
            found.append((WARM, later_ns, warm))
    return found


def imu(stamp_ns: int, x: float) -> Any:
    turn, none = arm.T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9)
    still, moved = (arm.T["geometry_msgs/msg/Vector3"](a, 0.0, -a) for a in (0.0, x))
    header = arm.header_at(stamp_ns)
    return arm.T["sensor_msgs/msg/Imu"](header, turn, none, still, none, moved, none)


def imported(tmp_path: Path, stand: Path) -> tuple[list[Scan], list[VibrationBlock]]:
    bag = arm.write_ros2(tmp_path / "joint", iter(sent()))
    assert main(["import", "--stand", str(stand), str(bag), "-o", str(tmp_path / "bags")]) == 0
    records = [r for _, r in read_bag(tmp_path / "bags" / "joint", (Scan, VibrationBlock))]
    scans = [record for record in records if isinstance(record, Scan)]
    return scans, [record for record in records if isinstance(record, VibrationBlock)]


def test_live_scans_are_those_of_an_import(domain: int, tmp_path: Path) -> None:
    stand = arm.arm_stand(tmp_path / "joint_stand", MAPPING)
    scans, tables, shaken = bridged(domain, str(stand), sent(), WARM, COUNT - 4)
    expected, blocks = imported(tmp_path, stand)
    assert [repr(block) for block in shaken] == [repr(block) for block in blocks[: len(shaken)]]
    samples = np.concatenate([block.points()[1] for block in blocks])
    np.testing.assert_allclose(samples[:, 0], 9.80665 * 0.25 * np.arange(COUNT), rtol=1e-6)
    assert len(shaken) >= len(blocks) - 1 > 5
    assert [repr(s) for s in scans] == [repr(s) for s in expected[: len(scans)]]
    assert len(expected) == COUNT
    axes = [f"accelerometer_1_{axis}" for axis in "xz"]
    assert [row.name for row in tables[-1].channels] == [*CHANNELS, *axes]
    assert tables[-1].info("motor_temperature").unit == "degC"  # type: ignore[union-attr]


LIVE_FIELDS = {
    "sensor_msgs.JointState": "effort[elbow]",
    "sensor_msgs.Temperature": "temperature",
    "sensor_msgs.BatteryState": "cell_voltage[1]",
    "sensor_msgs.Imu": "linear_acceleration.z",
    "geometry_msgs.WrenchStamped": "wrench.force.z",
    "std_msgs.Float64": "data",
    "std_msgs.Float64MultiArray": "data[1]",
    "diagnostic_msgs.DiagnosticArray": "status[motor].values[celsius].value",
}


def filled(message: Any) -> Any:
    """A message of rclpy with 2.5 in the field of its row."""
    from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

    match type(message).__name__:
        case "JointState":
            message.name, message.effort = ["shoulder", "elbow"], [1.0, 2.5]
        case "Temperature":
            message.temperature = 2.5
        case "BatteryState":
            message.cell_voltage = [1.0, 2.5]
        case "Imu":
            message.linear_acceleration.z = 2.5
        case "WrenchStamped":
            message.wrench.force.z = 2.5
        case "Float64":
            message.data = 2.5
        case "Float64MultiArray":
            message.data = [1.0, 2.5]
        case "DiagnosticArray":
            pair = KeyValue(key="celsius", value="2.5")
            message.status = [DiagnosticStatus(name="motor", values=[pair])]
    return message


@pytest.mark.parametrize("kind", LIVE_FIELDS)
def test_a_field_of_a_live_message_is_read(kind: str) -> None:
    package, name = kind.split(".")
    message = filled(getattr(importlib.import_module(f"{package}.msg"), name)())
    assert FieldPath.parsed(LIVE_FIELDS[kind], "here").read(message) == 2.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"type": "no_such_msgs/msg/Joint"}, "no_such_msgs/msg/Joint is not available"),
        ({"field": "effort[elbow"}, "field = 'effort[elbow' is no field of a message"),
    ],
)
def test_a_mapping_that_cannot_be_bridged_stops_the_start(
    domain: int, tmp_path: Path, changes: dict[str, str], words: str
) -> None:
    row = {**arm.CHANNELS["motor_current"], **changes}
    stand = arm.arm_stand(tmp_path / "mine", {**MAPPING, "channels": {"motor_current": row}})
    with Process(node("bridge", "-p", f"stand:={stand}"), domain) as process:
        assert process.end() == 2
    assert words in process.output


def test_a_stand_without_topics_is_refused_by_name(domain: int) -> None:
    with Process(node("bridge", "-p", "stand:=flea"), domain) as process:
        assert process.end() == 2
    assert "channels.yaml names no topics" in process.output
