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

"""A string parameter of another node of this namespace: its presence, and setting it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

LOOK_EVERY_S = 1.0
POLL_S = 0.02
ASK_AGAIN_S = 0.5
FIND_S = 2.0
ANSWER_S = 8.0

Every = Callable[[float, Callable[[], None]], Any]


class RemoteParameter:
    """One parameter of another node, which may start and stop at any time.

    Parameters
    ----------
    ros_node
        The requesting node of rclpy.
    every
        Starts a timer with a fixed period.
    node, name
        The other node, relative to this namespace, and its parameter.
    """

    def __init__(self, ros_node: Any, every: Every, node: str, name: str) -> None:
        from rcl_interfaces.srv import GetParameterTypes

        self._ros_node, self._every = ros_node, every
        self._node, self._name = node, name
        self.present = False
        """Whether the node is there and has declared the parameter as text."""
        self._types = ros_node.create_client(GetParameterTypes, f"{node}/get_parameter_types")
        self._request = GetParameterTypes.Request(names=[name])
        self._asked: Any = None
        every(LOOK_EVERY_S, self._look)

    def _look(self) -> None:
        from rcl_interfaces.msg import ParameterType

        if not self._types.service_is_ready():
            self.present, self._asked = False, None
            return
        if self._asked is not None and self._asked.done():
            types = getattr(self._asked.result(), "types", ())
            self.present = list(types) == [ParameterType.PARAMETER_STRING]
        if not self.present:  # an answer to a client not discovered by the server yet is lost
            self._asked = self._types.call_async(self._request)

    def set(self, value: str, told: Callable[[str], None]) -> None:
        """Set the parameter; ``told`` is called with the reason of a refusal, or ''."""
        from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
        from rcl_interfaces.srv import SetParameters

        node, began = self._node, time.monotonic()
        client = self._ros_node.create_client(SetParameters, f"{node}/set_parameters")
        content = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=self._name, value=content)])
        asked: list[Any] = []

        def watch() -> None:
            waited_s = time.monotonic() - began
            answers = [future.result() for future in asked if future.done()]
            if answers:
                result = answers[0].results[0]
                settle("" if result.successful else result.reason or f"refused by {node}")
            elif not asked and waited_s > FIND_S:
                settle(f"node {node} is not running")
            elif waited_s > FIND_S + ANSWER_S:
                settle(f"node {node} does not answer")
            elif waited_s >= ASK_AGAIN_S * len(asked) and client.service_is_ready():
                # Wait: an answer to a client that the server has not discovered yet is lost.
                asked.append(client.call_async(request))

        def settle(reason: str) -> None:
            timer.cancel()
            self._ros_node.destroy_client(client)
            told(reason)

        timer = self._every(POLL_S, watch)
