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

"""What around a node keeps it from working: no clock, and another node of its name."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from flea_diag.wire.messages.codec import message_class
from flea_diag.wire.records import Health

LOOK_S = 1.0
CLOCK_S = 3.0
"""Time in ``active`` without /clock after which it is missed; a player sends it once nodes are."""


class Surroundings:
    """Warns once of each thing that is wrong, and again when it has come back.

    Parameters
    ----------
    ros_node
        Node of rclpy.
    tell
        Logs a warning.
    working
        Says whether the node is active.
    own_stamps
        Stamps of the reports on /diagnostics that this node has just published.
    """

    def __init__(
        self,
        ros_node: Any,
        tell: Callable[[str], None],
        working: Callable[[], bool],
        own_stamps: Callable[[], frozenset[int]],
    ) -> None:
        self._node, self._tell, self._working = ros_node, tell, working
        self._own_stamps = own_stamps
        self._idle_s = time.monotonic()
        """Time since which the node has been active."""
        self._clock_missed = self._told = False
        self._reports: Any = None

    def look(self) -> None:
        """Look at clock and names; called about once a second."""
        self._look_for_clock()
        self._look_for_namesake()

    def _look_for_clock(self) -> None:
        now_s, clock = time.monotonic(), self._node.get_clock()
        if not self._working() or not clock.ros_time_is_active or clock.now().nanoseconds:
            self._idle_s, self._clock_missed = now_s, False
        elif not self._clock_missed and now_s - self._idle_s >= CLOCK_S:
            self._clock_missed = True
            self._tell(
                "use_sim_time is true and nothing comes on /clock, so the time of this node stands "
                "at 0: start what publishes it, or set use_sim_time to false"
            )

    def _look_for_namesake(self) -> None:
        """A name may be listed on for a node that was killed: only what speaks is another one."""
        own = self._node.get_name(), self._node.get_namespace()
        several = self._node.get_node_names_and_namespaces().count(own) > 1
        if several and self._reports is None and not self._told:
            self._listen()
        elif not several:
            self._told = False
            self._close()

    def _listen(self) -> None:
        from rclpy.qos import qos_profile_sensor_data

        self._reports = self._node.create_subscription(
            message_class(Health), "/diagnostics", self._heard, qos_profile_sensor_data
        )

    def _heard(self, message: Any) -> None:
        name = self._node.get_fully_qualified_name()
        stamp = message.header.stamp
        mine = stamp.sec * 1_000_000_000 + stamp.nanosec in self._own_stamps()
        if self._told or mine or all(s.name != name.lstrip("/") for s in message.status):
            return
        self._told = True
        self._tell(
            f"another node is called {name}, too: services and parameters reach either one, and "
            "both publish on the same topics; end one, or give it a namespace (-r __ns:=/stand_2)"
        )

    def _close(self) -> None:
        if self._reports is not None:
            self._node.destroy_subscription(self._reports)
            self._reports = None
