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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Who goes to one worker: a file, for its fixtures are shared, and all that start nodes.

    Two stands at once would take each other's time on a small machine.
    """
    if not config.pluginmanager.hasplugin("xdist"):
        return
    live = {item.path for item in items if "domain" in getattr(item, "fixturenames", ())}
    for item in items:
        group = "nodes" if item.path in live else item.path.stem
        item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain that nobody else on this machine uses."""
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")
    from flea_diag.nodes.run.domain import reserved_domain

    with reserved_domain() as number:
        yield number
