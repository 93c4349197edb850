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

"""The channels.yaml of docs/robots.md, read off messages of the types that they name."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from support.foreign import arm
from support.places import ROOT

from flea_diag.configuration.channels import channel_sources
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.sources.message_terms import MessageTerms

PAGE = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")
RECIPES = dict(re.findall(r'```yaml title="(\w+)"\n(.*?)```', PAGE, re.DOTALL))
JOINTS = ["shoulder", "elbow"]
INTERFACES = ["position", "velocity", "effort", "temperature", "Present Temperature"]
CURRENT, SPEED, ANGLE, WARM = 2.5, 1.25, 0.75, 31.0

DEFINITIONS = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": "std_msgs/Header header\nstring[] joint_names\n"
    "control_msgs/InterfaceValue[] interface_values\n",
    "control_msgs/msg/JointTrajectoryControllerState": "std_msgs/Header header\n"
    "string[] joint_names\n"
    + "".join(
        f"trajectory_msgs/JointTrajectoryPoint {name}\n"
        for name in ("reference", "feedback", "error", "output")
    ),
    "odrive_can/msg/ControllerStatus": "float32 pos_estimate\nfloat32 vel_estimate\n"
    "float32 torque_target\nfloat32 torque_estimate\nfloat32 iq_setpoint\nfloat32 iq_measured\n"
    "uint32 active_errors\nuint8 axis_state\nuint8 procedure_result\nbool trajectory_done_flag\n",
    "odrive_can/msg/ODriveStatus": "float32 bus_voltage\nfloat32 bus_current\n"
    "float32 fet_temperature\nfloat32 motor_temperature\nuint32 active_errors\n"
    "uint32 disarm_reason\n",
}


def types() -> Any:
    """The common interfaces and those of ros2_control and ODrive."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store.types


def messages() -> dict[str, Any]:
    """A message of each type with the same state of the elbow."""
    t = types()
    header = arm.header_at(10**18)
    two = {"position": (0.1, ANGLE), "velocity": (0.0, SPEED), "effort": (9.0, CURRENT)}
    row = [ANGLE, SPEED, CURRENT, WARM, WARM]
    interfaces = [
        t["control_msgs/msg/InterfaceValue"](INTERFACES, np.array(values))
        for values in ([0.0] * 5, row)
    ]
    point, empty = t["trajectory_msgs/msg/JointTrajectoryPoint"], np.array([])
    zero = t["builtin_interfaces/msg/Duration"](0, 0)
    feedback = point(np.array(two["position"]), np.array(two["velocity"]), empty, empty, zero)
    other = point(empty, empty, empty, empty, zero)
    return {
        "sensor_msgs/msg/JointState": t["sensor_msgs/msg/JointState"](
            header, JOINTS, *(np.array(values) for values in two.values())
        ),
        "control_msgs/msg/DynamicJointState": t["control_msgs/msg/DynamicJointState"](
            header, JOINTS, interfaces
        ),
        "control_msgs/msg/JointTrajectoryControllerState": t[
            "control_msgs/msg/JointTrajectoryControllerState"
        ](header, JOINTS, other, feedback, other, other),
        "odrive_can/msg/ControllerStatus": t["odrive_can/msg/ControllerStatus"](
            ANGLE, SPEED, 0.0, 0.0, 0.0, CURRENT, 0, 8, 0, False
        ),
        "odrive_can/msg/ODriveStatus": t["odrive_can/msg/ODriveStatus"](
            24.0, 1.0, 25.0, WARM, 0, 0
        ),
    }  # fmt: skip


def test_the_page_has_recipes() -> None:
    assert {"joint_states", "dynamic_joint_states", "controller_state", "odrive", "dynamixel"} == {
        *RECIPES
    }


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_reads_the_channels_of_a_joint(name: str, tmp_path: Any) -> None:
    joint = ROOT / "config" / "stands" / "joint"
    folder = arm.arm_stand(tmp_path / "mine", yaml.safe_load(RECIPES[name]), joint)
    mapping = channel_sources(load_stand(str(folder)))
    terms, sent = MessageTerms(mapping), messages()
    found = {
        k: v for topic, kind in mapping.topics.items() for k, v in terms.read(topic, sent[kind])
    }
    assert found.keys() == set(range(len(mapping.channels)))
    read = {row.channel: found[number] for number, row in enumerate(mapping.channels)}
    assert read["motor_current"] == CURRENT
    assert read["motor_speed"] == SPEED
    assert read["actuator_position"] == ANGLE
    assert read.get("motor_temperature", WARM) == WARM
