"""What differs between the distributions of ROS 2 that the nodes run with; all of it is here.

Jazzy is the default, Kilted the next one (`scripts/check --ros kilted`). Callbacks and imports are
written so that both take them: a timer's callback has no parameters, and `rclpy.experimental` is
looked for (``program.make_executor``).
"""

from __future__ import annotations

import os
from importlib.metadata import PackageNotFoundError, version

JAZZY, KILTED = "jazzy", "kilted"
FIRST_OF_KILTED = 8
"""Major version of rclpy from which on it is that of Kilted or later."""


def distribution() -> str:
    """The one that is sourced, or whose wheels are installed; newer ones count as Kilted."""
    try:
        return JAZZY if int(version("ros-rclpy").split(".")[0]) < FIRST_OF_KILTED else KILTED
    except PackageNotFoundError:
        return JAZZY if os.environ.get("ROS_DISTRO", JAZZY) == JAZZY else KILTED


def profiles_variable() -> str:
    """Environment variable that names the profiles of Fast DDS: 2.14 in Jazzy, 3 in Kilted."""
    return {
        JAZZY: "FASTRTPS_DEFAULT_PROFILES_FILE",
        KILTED: "FASTDDS_DEFAULT_PROFILES_FILE",
    }[distribution()]
