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

"""Topics of any message type that is installed: read, and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flea_diag.wire.bus import qos
from flea_diag.wire.bus.remote.remote_service import filled, interface

DEPTH = 100
"""Queue length: a driver's burst is taken whole."""


def check_interface(message: str) -> None:
    """Refuse a message type that is not installed.

    Raises
    ------
    ConfigurationError
        Names the type and its package.
    """
    interface(message)


def subscribe_foreign(ros_node: Any, topic: str, message: str, take: Callable[[Any], None]) -> None:
    """Call ``take`` with each message.

    Raises
    ------
    ConfigurationError
        The type is not installed.
    """
    ros_node.create_subscription(
        interface(message),
        topic,
        take,
        qos.of_sensor_data(DEPTH),
        qos_overriding_options=qos.overriding(),
    )


def advertise_foreign(
    ros_node: Any, topic: str, message: str
) -> Callable[[Mapping[str, Any]], None]:
    """A latched publisher: a function that publishes a message with these fields.

    Raises
    ------
    ConfigurationError
        The type is not installed.
    """
    kind = interface(message)
    publisher = ros_node.create_publisher(
        kind, topic, qos.reliable(1, latched=True), qos_overriding_options=qos.overriding()
    )
    return lambda values: publisher.publish(filled(kind, values))
