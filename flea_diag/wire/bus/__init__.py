"""The only interface to rclpy: publishes and receives records in a ROS graph.

``program`` runs a node as an executable, ``managed`` and ``life_cycle`` take it through its
states, ``endpoint`` holds its publishers and subscriptions, ``declared`` its parameters. Importing
this package does not import rclpy, so that ``--help`` works without ROS.
"""

from flea_diag.wire.bus.consumers import Consumers, named
from flea_diag.wire.bus.endpoint import Bus, Subscription
from flea_diag.wire.bus.guest import guest
from flea_diag.wire.bus.program import Program, run

__all__ = ["Bus", "Consumers", "Program", "Subscription", "guest", "named", "run"]
