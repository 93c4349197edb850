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

"""Messages through the bridge node, faster than real time, and the scans that it makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flea_diag.wire.records import ChannelTable, Health, Scan, VibrationBlock
from support.live import Peer, Process, node

LIMIT_S = 60.0
TOGETHER = 50
"""Messages that are sent at once: half of what a queue here holds."""
RELIABLE = "qos_overrides.{}.subscription.reliability:=reliable"


def bridged(
    domain: int, stand: str, sent: Sequence[tuple[str, int, Any]], paced: str, least: int
) -> tuple[list[Scan], list[ChannelTable], list[VibrationBlock]]:
    """Scans, at least so many, channel tables and vibration that the bridge makes of messages.

    No message overtakes one of the topic ``paced``, or every ``TOGETHER``-th of a fast one: the
    bridge has said first that it has all.
    """
    from geometry_msgs.msg import WrenchStamped
    from sensor_msgs.msg import BatteryState, Imu, JointState, Temperature

    every = (BatteryState, Imu, JointState, Temperature, WrenchStamped)
    kinds = {kind.__name__: kind for kind in every}
    of_topic = {topic: kinds[type(message).__name__.split("__")[-1]] for topic, _, message in sent}
    given = [f"stand:={stand}", *(RELIABLE.format(topic) for topic in of_topic)]
    command = node("bridge", *(part for each in given for part in ("-p", each)))
    with Process(command, domain) as process, Peer(domain) as peer:
        writers = {
            topic: peer.node.create_publisher(kind, topic, 100) for topic, kind in of_topic.items()
        }
        peer.listen(ChannelTable, Scan, VibrationBlock, Health)
        peer.until(lambda: all(w.get_subscription_count() for w in writers.values()), LIMIT_S)
        count: dict[str, int] = {}
        apart = 0
        for number, (topic, _, message) in enumerate(sent):
            paces = topic == paced and number >= apart
            if paces:
                peer.until(lambda: _counted(peer.records, count), LIMIT_S)
            writers[topic].publish(_live(of_topic[topic], message))
            count[topic] = count.get(topic, 0) + 1
            if paces:
                peer.until(lambda: _counted(peer.records, count), LIMIT_S)
                apart = number + TOGETHER
        peer.until(lambda: sum(isinstance(r, Scan) for r in peer.records) >= least, LIMIT_S)
        process.child.terminate()
        assert process.end() == 0, process.output
    scans = [record for record in peer.records if isinstance(record, Scan)]
    tables = [record for record in peer.records if isinstance(record, ChannelTable)]
    return scans, tables, [r for r in peer.records if isinstance(r, VibrationBlock)]


def _live(kind: Any, message: Any) -> Any:
    """The same message for rclpy."""
    made = kind()
    made.header.stamp.sec = int(message.header.stamp.sec)
    made.header.stamp.nanosec = int(message.header.stamp.nanosec)
    if hasattr(message, "name"):
        made.name = message.name
        for field in ("position", "velocity", "effort"):
            setattr(made, field, getattr(message, field).tolist())
    elif hasattr(message, "temperature"):
        made.temperature = float(message.temperature)
        if hasattr(message, "voltage"):
            made.voltage = float(message.voltage)
    elif hasattr(message, "wrench"):
        _fill(made.wrench.torque, message.wrench.torque)
    else:
        _fill(made.linear_acceleration, message.linear_acceleration)
        _fill(made.angular_velocity, message.angular_velocity)
    return made


def _fill(vector: Any, given: Any) -> None:
    for axis in "xyz":
        setattr(vector, axis, float(getattr(given, axis)))


def _counted(records: list[Any], count: dict[str, int]) -> bool:
    """Whether the bridge has said that it received so many messages."""
    wanted = {f"{topic}/received": str(n) for topic, n in count.items()}
    said = [dict(r.values) for r in records if isinstance(r, Health) and r.node == "bridge"]
    return bool(said) and wanted.items() <= said[-1].items()
