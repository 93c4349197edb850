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

"""Messages of ros2_control (control_msgs), which bags in SQLite do not define."""

from __future__ import annotations

from typing import Any

_POINT = "trajectory_msgs/JointTrajectoryPoint"
DEFINITIONS: dict[str, tuple[tuple[str, str], ...]] = {
    "control_msgs/msg/DynamicJointState": (
        (
            "control_msgs/msg/InterfaceValue",
            "string[] interface_names\nfloat64[] values\n",
        ),
        (
            "control_msgs/msg/DynamicJointState",
            "std_msgs/Header header\nstring[] joint_names\n"
            "control_msgs/InterfaceValue[] interface_values\n",
        ),
    ),
    "control_msgs/msg/JointTrajectoryControllerState": (
        (
            "control_msgs/msg/JointTrajectoryControllerState",
            "std_msgs/Header header\nstring[] joint_names\n"
            f"{_POINT} reference\n{_POINT} feedback\n{_POINT} error\n{_POINT} output\n",
        ),
    ),
}
"""Message -> the types that it needs, in order, each with its definition as of ROS 2 Humble."""


def controller_types(message: str, known: Any) -> dict[str, Any]:
    """Types of a message of control_msgs and all that it needs; empty for any other."""
    from rosbags.typesys import get_types_from_msg

    if message not in DEFINITIONS:
        return {}
    found = dict(known.fielddefs)
    for name, text in DEFINITIONS[message]:
        found |= get_types_from_msg(text, name)
    return found
