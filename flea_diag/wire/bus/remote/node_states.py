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

"""Life-cycle states of other nodes, as each of them announces its own."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

from flea_diag.wire.bus.life_cycle import ACTIVE, STATE_TOPIC, latched

NOT_STARTED = "not started"


class NodeStates:
    """Latest state of each of the named nodes of this namespace.

    Parameters
    ----------
    ros_node
        The node of rclpy that looks.
    names
        Nodes, relative to its namespace.
    """

    def __init__(self, ros_node: Any, names: Iterable[str]) -> None:
        from lifecycle_msgs.msg import State

        self._ros_node = ros_node
        self._states = dict.fromkeys(names, NOT_STARTED)
        for name in self._states:
            topic = f"{name}/{STATE_TOPIC}"
            ros_node.create_subscription(State, topic, partial(self._note, name), latched())

    def _note(self, name: str, state: Any) -> None:
        self._states[name] = str(state.label)

    def of(self, name: str) -> str:
        """State by the name of ROS 2; ``not started`` while there is no such node."""
        if not self._ros_node.count_publishers(f"{name}/{STATE_TOPIC}"):
            return NOT_STARTED
        return self._states[name]

    def not_active(self) -> dict[str, str]:
        """Nodes that are not active, with their states."""
        found = {name: self.of(name) for name in self._states}
        return {name: state for name, state in found.items() if state != ACTIVE}
