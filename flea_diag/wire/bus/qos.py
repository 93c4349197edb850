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

"""Quality of service of the topics of a node; each may be overridden by parameters of ROS."""

from __future__ import annotations

from typing import Any


def reliable(depth: int, latched: bool) -> Any:
    """Reliable, and where it is latched so many for late joiners."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
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


def weaker(asked: Any, offered: Any) -> Any:
    """What a reader may ask for to get what is offered; None where it gets it as it is."""
    from rclpy.qos import (
        DurabilityPolicy,
        QoSCompatibility,
        QoSProfile,
        ReliabilityPolicy,
        qos_check_compatible,
    )

    if qos_check_compatible(offered, asked)[0] != QoSCompatibility.ERROR:
        return None
    lossy = ReliabilityPolicy.BEST_EFFORT in (asked.reliability, offered.reliability)
    volatile = DurabilityPolicy.VOLATILE in (asked.durability, offered.durability)
    return QoSProfile(
        history=asked.history,
        depth=asked.depth,
        reliability=ReliabilityPolicy.BEST_EFFORT if lossy else asked.reliability,
        durability=DurabilityPolicy.VOLATILE if volatile else asked.durability,
    )


def words(profile: Any) -> str:
    """Reliability and durability as people say them."""
    kept = "latched" if profile.durability.name == "TRANSIENT_LOCAL" else ""
    return f"{profile.reliability.name.lower().replace('_', ' ')} {kept}".strip()
