"""Fixtures for all tests."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import hypothesis
import pytest

# CI judges a change, not a draw of luck: the same examples each time there, new ones elsewhere.
hypothesis.settings.register_profile("ci", derandomize=True, deadline=None)
if os.environ.get("CI"):
    hypothesis.settings.load_profile("ci")

# A shell has its background jobs ignore Ctrl-C, and so would whatever the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain that nobody else on this machine uses."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    from flea_diag.nodes.domain import reserved_domain

    with reserved_domain() as number:
        yield number
