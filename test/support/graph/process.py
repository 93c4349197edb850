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

"""A program of the package as a process of a simulated graph: its node, bus and life cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from flea_diag.errors import FleaError
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.life_cycle import ACTIVATE, CONFIGURE
from flea_diag.wire.bus.managed import Managed
from support.graph.network import Network
from support.graph.ros_node import RosNode


class Finished:
    """Future of rclpy whose completion ends a program."""

    def __init__(self) -> None:
        self.value: Any = None
        self._done = False

    def done(self) -> bool:
        """Whether the program has been asked to end."""
        return self._done

    def set_result(self, value: Any) -> None:
        """Ask the program to end."""
        self.value, self._done = value, True

    set_exception = set_result


class GraphProcess:
    """One program, configured and active.

    Parameters
    ----------
    network : of the graph
    program : what runs
    values : parameters that differ from the defaults
    cost_ns : draws how long a callback takes
    activate : whether it is, at once
    """

    def __init__(
        self,
        network: Network,
        program: Program,
        values: dict[str, Any],
        cost_ns: Callable[[], int] = lambda: 0,
        activate: bool = True,
    ) -> None:
        self._network = network
        self.finished = Finished()
        self.node = RosNode(network, program.name, values=values, cost_ns=cost_ns)
        declared: Declared[Any] = Declared(self.node, program.parameters)
        self.bus: Bus[Any] = Bus(self.node, self.node, declared, self.finished)
        # What is compiled is compiled: it takes real time and none of the graph's.
        warm = replace(program, prepare=None)
        self.managed = Managed(warm, self.bus, self.node, lambda: declared.value)
        declared.is_fixed = lambda: self.managed.configured
        self.node.after_each = self._end_if_asked
        self.change(CONFIGURE)
        if activate and not self.over:
            self.change(ACTIVATE)
        self._end_if_asked()

    @property
    def running(self) -> bool:
        """Whether it is neither killed nor ended."""
        return self.running_node and not self.over

    @property
    def over(self) -> bool:
        """Whether it has ended by itself."""
        return self.finished.done() or self.node.raised is not None

    def change(self, transition: str) -> None:
        """Make a whole transition of its life cycle."""
        try:
            self.managed.change(transition)
        except FleaError as error:
            self.bus.end(error)

    def _end_if_asked(self) -> None:
        if self.over and self.running_node:
            self.end()

    @property
    def running_node(self) -> bool:
        """Whether its node is in the graph."""
        return self.node in self._network.nodes

    def end(self) -> None:
        """End it in order."""
        if not self.running_node:
            return
        try:
            self.managed.close()
        except FleaError as error:
            self.finished.set_result(error)
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        if self.running_node:
            self.node.kill()
