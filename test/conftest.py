"""Fixtures for all tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain that nobody else on this machine uses."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    from flea_diag.nodes.domain import reserved_domain

    with reserved_domain() as number:
        yield number
