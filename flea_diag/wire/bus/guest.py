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

"""A bus for a program that is not a node itself: a live run waiting for nodes, a test."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.endpoint import Bus


@dataclass(frozen=True)
class NoParameters:
    """A guest has no parameters."""


@contextmanager
def guest(name: str, domain: int, namespace: str = "") -> Iterator[Bus[NoParameters]]:
    """Join the graph of a domain under this node name, with its own context.

    Callbacks run only inside ``Bus.wait_until``; signal handling is left to the caller.
    """
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.task import Future

    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node(
        name,
        context=context,
        namespace=namespace,
        use_global_arguments=False,
        automatically_declare_parameters_from_overrides=True,
    )
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield Bus(node, executor, Declared(node, NoParameters), Future())
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
