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

"""A further managed node in a process: own namespace, own parameters, the same executor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.endpoint import Bus
from flea_diag.wire.bus.managed import Managed
from flea_diag.wire.bus.program import Program

SIM_TIME = "use_sim_time"


class NodeBeside:
    """A program that runs beside others in one process.

    Parameters
    ----------
    host
        Bus of the node whose process and executor it shares.
    program
        What runs; all of it is configured and activated by request.
    namespace
        Relative to that of the host.
    values
        Parameters that differ from the defaults.

    Raises
    ------
    ConfigurationError
        A value is refused.
    """

    def __init__(
        self, host: Bus[Any], program: Program, namespace: str, values: Mapping[str, Any]
    ) -> None:
        from rclpy.lifecycle import LifecycleNode
        from rclpy.parameter import Parameter
        from rclpy.task import Future

        own, self._executor = host._node, host._executor
        given = {SIM_TIME: own.get_parameter(SIM_TIME).value, **values}
        self._node = LifecycleNode(
            program.name,
            context=own.context,
            namespace="/".join((own.get_namespace().rstrip("/"), namespace)),
            # Those of the command line are the host's.
            use_global_arguments=False,
            automatically_declare_parameters_from_overrides=True,
            parameter_overrides=[Parameter(key, value=each) for key, each in given.items()],
        )
        self._executor.add_node(self._node)
        declared: Declared[Any] = Declared(self._node, program.parameters)
        self.bus: Bus[Any] = Bus(self._node, self._executor, declared, Future())
        self.managed = Managed(program, self.bus, self._node, lambda: declared.value)
        declared.is_fixed = lambda: self.managed.configured

    def close(self) -> None:
        """Close the program and destroy the node."""
        self.managed.close()
        self._executor.remove_node(self._node)
        self._node.destroy_node()
