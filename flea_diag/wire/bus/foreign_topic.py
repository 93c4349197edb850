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
