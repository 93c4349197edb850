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

"""Publishers of one node, and the readers that they have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flea_diag.wire.bus import qos
from flea_diag.wire.messages import codec
from flea_diag.wire.topics import TOPIC_OF, Topic


class Publishers(dict[type, Any]):
    """Publishers by record type.

    Parameters
    ----------
    ros_node
        The node of rclpy.
    topic_name
        Name of a topic as it is given to the node.
    """

    def __init__(self, ros_node: Any, topic_name: Callable[[Topic], str]) -> None:
        super().__init__()
        self._ros_node, self._topic_name = ros_node, topic_name

    def advertise(self, record_type: type) -> None:
        """Create a publisher, unless there is one."""
        if record_type in self:
            return
        topic = TOPIC_OF[record_type]
        self[record_type] = self._ros_node.create_publisher(
            codec.message_class(record_type),
            self._topic_name(topic),
            qos.reliable(topic.depth, topic.latched),
            qos_overriding_options=qos.overriding(),
        )

    def forget_but(self, record_type: type) -> None:
        """Forget all others; the node destroys them."""
        for kind in self.keys() - {record_type}:
            del self[kind]

    def matched(self, record_type: type) -> int:
        """Number of subscriptions connected to this node's publisher."""
        self.advertise(record_type)
        return int(self[record_type].get_subscription_count())

    def listeners(self, record_type: type) -> set[str]:
        """Names of the nodes of this namespace that have subscribed to the record's topic."""
        here = self._ros_node.get_namespace()
        found = self._found(record_type)
        return {str(info.node_name) for info in found if info.node_namespace == here}

    def connected(self, record_type: type) -> bool:
        """Whether every subscription found in the graph is connected to this node's publisher.

        Not counted are those that ask for more than is offered: they never will be.
        """
        from rclpy.qos import QoSCompatibility, qos_check_compatible

        matched = self.matched(record_type)
        offered = self[record_type].qos_profile
        possible = sum(
            qos_check_compatible(offered, info.qos_profile)[0] != QoSCompatibility.ERROR
            for info in self._found(record_type)
        )
        return bool(matched >= possible)

    def acknowledged(self, record_type: type) -> bool:
        """Whether every connected reader has what was published; each of them knows this writer.

        A writer may find a reader before the reader finds the writer, and what is published in
        between is lost.
        """
        from rclpy.duration import Duration

        return bool(self[record_type].wait_for_all_acked(Duration(nanoseconds=0)))

    def _found(self, record_type: type) -> Any:
        """Subscriptions to the topic, in any process."""
        name = self._ros_node.resolve_topic_name(self._topic_name(TOPIC_OF[record_type]))
        return self._ros_node.get_subscriptions_info_by_topic(name)
