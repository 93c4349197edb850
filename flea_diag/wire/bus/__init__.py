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

"""The only interface to rclpy: publishes and receives records in a ROS graph.

``program`` runs a node as an executable, ``managed`` and ``life_cycle`` take it through its
states. ``endpoint`` is what it uses of ROS: ``publishers`` and the readers that they have,
``subscription`` with its counters, ``declared`` parameters. Importing this package does not import
rclpy, so that ``--help`` works without ROS.
"""

from flea_diag.wire.bus.consumers import Consumers, named
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.bus.guest import guest
from flea_diag.wire.bus.program import Program, run
from flea_diag.wire.bus.subscription import Subscription

__all__ = ["Bus", "Consumers", "Program", "Subscription", "guest", "named", "run"]
