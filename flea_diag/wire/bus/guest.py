"""A bus inside a program that is no node itself: a live run that waits for others, a test."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flea_diag.wire.bus.declared import Declared
from flea_diag.wire.bus.endpoint import Bus


@dataclass(frozen=True)
class NoParameters:
    """A guest has none."""


@contextmanager
def guest(name: str, domain: int, namespace: str = "") -> Iterator[Bus[NoParameters]]:
    """Join the graph of a domain under this node name, with a context of its own.

    Nothing is served but inside ``Bus.wait_until``; signals are left to the caller.
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
