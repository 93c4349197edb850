"""The end of rclpy's context, which a signal brings about at any moment, also during a call."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


def shutdown_errors() -> tuple[type[Exception], ...]:
    """Errors that rclpy raises when its context ends during a call."""
    from rclpy.exceptions import NotInitializedException
    from rclpy.impl.implementation_singleton import rclpy_implementation as c

    return (NotInitializedException, c.InvalidHandle, c.RCLError)


@contextmanager
def unless_ended(context: Any) -> Iterator[None]:
    """Suppress these errors once the context has ended; an executor would log each as fatal."""
    try:
        yield
    except Exception as error:
        if context.ok() or not isinstance(error, shutdown_errors()):
            raise
