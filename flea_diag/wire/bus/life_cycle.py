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

"""Managed life cycle of a node, as ROS 2 defines it (design article "Managed nodes").

State machine, services and ``transition_event`` are those of rcl. Added here: the state is also
latched on ``~/state``, so that a late joiner knows it, and a transition that is not possible is
refused in words instead of ending the node.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flea_diag.errors import FleaError, line_of

STATE_TOPIC = "state"
UNCONFIGURED, INACTIVE, ACTIVE = "unconfigured", "inactive", "active"
CONFIGURE, ACTIVATE, DEACTIVATE = "configure", "activate", "deactivate"
CLEANUP, SHUTDOWN = "cleanup", "shutdown"


def latched() -> Any:
    """QoS of the state: reliable, and the last one for late joiners."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


class LifeCycle:
    """States and transitions of one node.

    Parameters
    ----------
    node
        A ``LifecycleNode`` of rclpy.
    duties
        Transition -> what is done for it; a ``FleaError`` makes the transition fail.
    entered
        Called with each state that the node enters.
    """

    def __init__(
        self,
        node: Any,
        duties: Mapping[str, Callable[[], None]],
        entered: Callable[[str], None],
    ) -> None:
        from lifecycle_msgs.msg import State

        self._node, self._duties, self._entered = node, duties, entered
        self._machine = node._state_machine
        self._publisher = node.create_publisher(State, f"~/{STATE_TOPIC}", latched())
        # That of rclpy raises for a transition that is not possible, which ends the node.
        node._service_change_state.callback = self._requested
        self._announce()

    @property
    def state(self) -> str:
        """Present state, by the name of ROS 2."""
        return str(self._machine.current_state[1])

    def begin(self, transition: str) -> None:
        """Enter a transition state, for example ``configuring``, or leave it."""
        self._machine.trigger_transition_by_label(transition, True)
        self._announce()

    def end(self, *, success: bool) -> None:
        """Leave the transition state: for the next primary state, or back to the previous one."""
        self.begin("transition_success" if success else "transition_failure")

    def change(self, transition: str) -> None:
        """Make a whole transition.

        Raises
        ------
        FleaError
            The transition failed; the node is in its previous state.
        """
        self.begin(transition)
        try:
            self._duties[transition]()
        except FleaError:
            self.end(success=False)
            raise
        self.end(success=True)

    def _announce(self) -> None:
        from lifecycle_msgs.msg import State

        number, label = self._machine.current_state
        self._entered(label)
        self._publisher.publish(State(id=number, label=label))

    def _requested(self, request: Any, response: Any) -> Any:
        """Answer ``~/change_state``."""
        possible = {number: label for number, label, *_ in self._machine.available_transitions}
        asked = request.transition
        wanted = asked.label or possible.get(asked.id, f"number {asked.id}")
        response.success = wanted in self._duties and wanted in possible.values()
        log = self._node.get_logger()
        if not response.success:
            known = ", ".join(label for label in possible.values() if label in self._duties)
            log.warning(
                line_of(
                    f"transition {wanted!r} refused in state {self.state}: "
                    + (f"possible are {known}" if known else "wait until it is over")
                )
            )
            return response
        try:
            self.change(wanted)
        except FleaError as error:
            response.success = False
            log.error(line_of(f"transition {wanted} failed: {error}"))
        return response
