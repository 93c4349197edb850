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
