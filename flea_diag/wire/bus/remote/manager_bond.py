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

"""A bond with a manager of life cycles, such as nav2's: a heartbeat while the node is active.

The manager takes a node for dead whose heartbeat stays away, and one that says so for gone. The
protocol is that of bondcpp: each side says a status under the name of the node, with an id of its
own, on ``bond``.
"""

from __future__ import annotations

import uuid
from typing import Any

from flea_diag.wire.bus import qos
from flea_diag.wire.bus.life_cycle import ACTIVE
from flea_diag.wire.bus.remote.remote_service import filled, interface

STATUS, TOPIC = "bond/msg/Status", "bond"
TIMEOUT_S = 4.0
"""Time after which the manager may take the node for dead, as nodes of nav2 state it."""
DEPTH = 100


class ManagerBond:
    """The heartbeat of one node; an instance anew each time that it is activated.

    Parameters
    ----------
    ros_node
        The node of rclpy.
    period_s
        Of the heartbeat.

    Raises
    ------
    ConfigurationError
        The package ``bond`` is not installed.
    """

    def __init__(self, ros_node: Any, period_s: float) -> None:
        self._kind = interface(STATUS)
        self._name, self._period_s = str(ros_node.get_name()), period_s
        self._publisher = ros_node.create_publisher(
            self._kind, TOPIC, qos.reliable(DEPTH, latched=False)
        )
        self._instance = ""

    def enter(self, state: str) -> None:
        """The node has entered a state: the bond begins with activity and is broken after it."""
        if state == ACTIVE:
            self._instance = str(uuid.uuid4())
            self.beat()
        elif self._instance:
            self._say(active=False)
            self._instance = ""

    def beat(self) -> None:
        """Say that the node lives, if it is active."""
        if self._instance:
            self._say(active=True)

    def _say(self, active: bool) -> None:
        values = {
            "id": self._name,
            "instance_id": self._instance,
            "active": active,
            "heartbeat_timeout": TIMEOUT_S,
            "heartbeat_period": self._period_s,
        }
        self._publisher.publish(filled(self._kind, values))
