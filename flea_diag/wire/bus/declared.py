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

"""ROS parameters of a node, declared from a frozen parameter class (``wire.parameters``).

Types, defaults, units, bounds and descriptions in ``ros2 param describe`` come from that class.
An invalid value stops the node at start; later it is refused with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Generic, TypeVar

from flea_diag.errors import ConfigurationError
from flea_diag.wire.parameters import Descriptor, build, descriptors, parameter

P = TypeVar("P")

FOREIGN = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters declared by rclpy."""

ONCE_CONFIGURED = "read-only once configured"
INTEGER_LIMITS = (-(2**63), 2**63 - 1)


@dataclass(frozen=True)
class Common:
    """Parameters common to all nodes."""

    executor: str = parameter(
        "events",
        "executor of rclpy: events (a tenth of the CPU) or single (single-threaded)",
        choices=("events", "single"),
        read_only=True,
    )
    autostart: bool = parameter(
        True,
        "configure and activate at the start; false: wait for ~/change_state",
        read_only=True,
    )
    bond_heartbeat_period: float = parameter(
        0.0,
        "of the bond with a manager of life cycles, as nav2 has one; 0: none (needs package bond)",
        unit="s",
        minimum=0.0,
        read_only=True,
    )


class Declared(Generic[P]):
    """The parameters of one node; ``value`` is always complete and valid."""

    def __init__(self, node: Any, parameters: type[P]) -> None:
        where = f"node {node.get_name()}"
        given = _take_overrides(node)
        common = {
            entry.name: given.pop(entry.name) for entry in fields(Common) if entry.name in given
        }
        self._known = {entry.name: entry for entry in descriptors(parameters)}
        self._where = where
        self.common = build(Common, common, where)
        self.value: P = build(parameters, given, where)
        self.is_fixed: Callable[[], bool] = lambda: True
        """Whether the node is configured: what is read-only then can no longer be changed."""
        self.on_check: list[Callable[[P], None]] = []
        self.on_change: list[Callable[[P], None]] = []
        for owner, kind in ((self.common, Common), (self.value, parameters)):
            for entry in descriptors(kind):
                _declare(node, entry, getattr(owner, entry.name), kind is Common)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _validate(self, parameters: list[Any]) -> Any:
        from rcl_interfaces.msg import SetParametersResult

        try:
            self._refuse_fixed(parameters)
            merged = self._merged(parameters)
            for check in self.on_check:
                check(merged)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _refuse_fixed(self, parameters: list[Any]) -> None:
        for entry in parameters:
            known = self._known.get(entry.name)
            if known is not None and known.read_only and self.is_fixed():
                raise ConfigurationError(
                    f"{self._where}: {entry.name} is read-only once the node is configured: "
                    "deactivate it and clean it up (ros2 lifecycle set NODE cleanup) to change it"
                )

    def _apply(self, parameters: list[Any]) -> None:
        merged = self._merged(parameters)
        if merged != self.value:
            self.value = merged
            for apply in self.on_change:
                apply(merged)

    def _merged(self, parameters: list[Any]) -> P:
        given = {entry.name: entry.value for entry in parameters if entry.name in self._known}
        made = build(type(self.value), given, self._where)
        return replace(self.value, **{name: getattr(made, name) for name in given})  # type: ignore[type-var]


def _take_overrides(node: Any) -> dict[str, Any]:
    """Values given on the command line or in a file, by name, undeclared from the node.

    The node was created with ``automatically_declare_parameters_from_overrides``, so that
    undeclared names are seen too and a misspelt name is refused.
    """
    given = {
        name: entry.value
        for name, entry in node.get_parameters_by_prefix("").items()
        if not name.startswith(FOREIGN)
    }
    for name in given:
        node.undeclare_parameter(name)
    return given


def _declare(node: Any, entry: Descriptor, value: Any, read_only: bool) -> None:
    """``read_only`` means for ever; of others ``Declared`` refuses a change in time."""
    node.declare_parameter(
        entry.name,
        list(value) if isinstance(value, tuple) else value,
        _ros_descriptor(entry, read_only),
        ignore_override=True,
    )


def _ros_descriptor(entry: Descriptor, read_only: bool) -> Any:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    descriptor = ParameterDescriptor(
        name=entry.name,
        description=entry.doc + (f" [{entry.unit}]" if entry.unit else ""),
        additional_constraints=" | ".join(entry.choices)
        or (ONCE_CONFIGURED if entry.read_only and not read_only else ""),
        read_only=read_only,
    )
    if entry.minimum is None and entry.maximum is None:
        return descriptor
    if entry.kind is float:
        low, high = _limits(entry, (-math.inf, math.inf))
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    elif entry.kind is int:
        low, high = _limits(entry, INTEGER_LIMITS)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


def _limits(entry: Descriptor, unlimited: tuple[float, float]) -> tuple[float, float]:
    low, high = unlimited
    return (
        low if entry.minimum is None else entry.minimum,
        high if entry.maximum is None else entry.maximum,
    )
