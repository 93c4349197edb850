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

"""The log of a node, on its terminal and on /rosout."""

from __future__ import annotations

import math
import time
from typing import Any

from flea_diag.errors import line_of

WARN_EVERY_S = 5.0
"""Shortest period between two warnings in the log; the counters count every event."""


class NodeLog:
    """Logs lines through the logger of a node.

    Parameters
    ----------
    node
        Node of rclpy.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._warned_s = -math.inf

    # rclpy keeps severity and throttling by line of code, hence one line for each.

    def debug(self, text: str) -> None:
        """Log a line for those who ask for it."""
        self._node.get_logger().debug(line_of(text))

    def info(self, text: str) -> None:
        """Log a line."""
        self._node.get_logger().info(line_of(text))

    def caution(self, text: str) -> None:
        """Log a warning each time."""
        self._node.get_logger().warning(line_of(text))

    def error(self, text: str) -> None:
        """Log an error each time."""
        self._node.get_logger().error(line_of(text))

    def warn(self, text: str) -> None:
        """Log a warning, throttled: one limit for all such warnings of a node.

        The throttle of rclpy takes as long as the judgement of a scan, also for a line that it
        does not log: too long for each message of a flood.
        """
        now_s = time.monotonic()
        if now_s - self._warned_s >= WARN_EVERY_S:
            self._warned_s = now_s
            self._node.get_logger().warning(line_of(text))
