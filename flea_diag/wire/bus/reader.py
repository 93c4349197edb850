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

"""The subscription to one topic, which asks for less where a writer offers less.

ROS matches no reliable reader with a best-effort writer, and no reader of latched messages with a
writer that keeps none: such a reader gets nothing. Drivers often send sensor data best effort.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.wire.bus import qos
from flea_diag.wire.bus.subscription import Subscription

NAMELESS = "_NODE_NAME_UNKNOWN_"
"""Name that the graph gives to the node of an endpoint before it knows the node."""


def sources_of(ros_node: Any, topic: str) -> tuple[str, ...]:
    """Nodes that publish a topic, with their namespaces, one for each publisher.

    Not those whose names the graph does not know yet.
    """
    found = ros_node.get_publishers_info_by_topic(topic)
    names = (f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found)
    return tuple(sorted(name for name in names if NAMELESS not in name))


class Reader:
    """A raw subscription, made again once a writer turns up that it is not compatible with.

    Parameters
    ----------
    ros_node
        Node of rclpy.
    message
        Class of the messages.
    name
        Of the topic, as given to the node.
    stream, take
        Counters, and what takes the bytes.
    profile
        Quality of service to ask for first.
    tell
        Logs a warning.
    """

    def __init__(
        self,
        ros_node: Any,
        message: Any,
        name: str,
        stream: Subscription,
        take: Callable[[bytes], None],
        profile: Any,
        tell: Callable[[str], None],
    ) -> None:
        self._ros_node, self._message, self._name = ros_node, message, name
        self._stream, self._take, self._tell = stream, take, tell
        self._made = self._subscribed(profile, qos.overriding())

    def _subscribed(self, profile: Any, overriding: Any) -> Any:
        return self._ros_node.create_subscription(
            self._message,
            self._name,
            self._stream.receiver(
                self._take, lambda: int(self._made.get_publisher_count()), self._sources
            ),
            profile,
            qos_overriding_options=overriding,
            raw=True,
        )

    def _sources(self) -> tuple[str, ...]:
        return sources_of(self._ros_node, self._ros_node.resolve_topic_name(self._name))

    def look(self) -> None:
        """Ask for less, with a warning that names the pair, if a writer offers less."""
        name = self._ros_node.resolve_topic_name(self._name)
        if self._ros_node.count_publishers(name) <= self._made.get_publisher_count():
            return
        asked = self._made.qos_profile
        for info in self._ros_node.get_publishers_info_by_topic(name):
            less = qos.weaker(asked, info.qos_profile)
            if less is None or NAMELESS in info.node_name:
                continue  # the pair is named with the next look
            former, self._made = self._made, self._subscribed(less, None)
            self._ros_node.destroy_subscription(former)
            writer = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            self._tell(
                f"{name}: {writer} sends {qos.words(info.qos_profile)}, while this node asks for "
                f"{qos.words(asked)}: reading {qos.words(less)}; lost messages are not sent again"
            )
            return

    def destroy(self) -> None:
        """Take no more messages."""
        self._ros_node.destroy_subscription(self._made)
