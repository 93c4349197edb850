"""The reporter where ros2_medkit is not installed; what it reports is in test_fault_report."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from support.live import Process, node


@pytest.mark.skipif(find_spec("ros2_medkit_msgs") is not None, reason="ros2_medkit is installed")
def test_without_the_type_of_the_service_it_says_what_to_install(domain: int) -> None:
    with Process(node("flea_diag.nodes.operator.fault_reporter"), domain) as process:
        process.wait_for("install the package ros2_medkit_msgs and source it\n")
        assert process.child.wait(20.0) == 2
    assert process.output.count("\n") == 1
