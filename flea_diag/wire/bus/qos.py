"""Quality of service of the topics of a node; each may be overridden by parameters of ROS."""

from __future__ import annotations

from typing import Any

from flea_diag.wire.topics import Topic


def of_topic(topic: Topic, depth: int) -> Any:
    """Reliable, and of a latched topic the last one for late joiners."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )


def of_sensor_data(depth: int) -> Any:
    """Best effort, which is compatible with every publisher."""
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.BEST_EFFORT,
    )


def overriding() -> Any:
    """Which of it parameters may override: history, depth and reliability."""
    from rclpy.qos_overriding_options import QoSOverridingOptions

    return QoSOverridingOptions.with_default_policies()
