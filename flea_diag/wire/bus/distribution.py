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
