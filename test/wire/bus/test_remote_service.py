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

"""Requests of a service whose type is known at run time only."""

from __future__ import annotations

from typing import Any

import pytest
from support.live import Peer

from flea_diag.errors import ConfigurationError
from flea_diag.wire.bus.remote.remote_service import RemoteService, filled, interface


@pytest.fixture(autouse=True)
def _rclpy() -> None:
    pytest.importorskip("rclpy", reason="needs ROS 2: rclpy is not installed")


def test_a_message_takes_the_fields_that_it_has_and_builds_its_parts() -> None:
    kind = interface("diagnostic_msgs/msg/DiagnosticStatus")
    values: dict[str, Any] = {
        "name": "jam",
        "values": [{"key": "size", "value": "120.5 N"}],
        "evidence": [{"key": "of a newer release", "value": ""}],
    }
    status = filled(kind, values)
    assert (status.name, status.message) == ("jam", "")
    assert [(pair.key, pair.value) for pair in status.values] == [("size", "120.5 N")]


@pytest.mark.parametrize("name", ["no_such_msgs/srv/ReportFault", "std_srvs/srv/ReportFault"])
def test_a_type_that_is_not_installed_is_named_with_the_remedy(name: str) -> None:
    with pytest.raises(ConfigurationError, match=f"the interface {name} is not available") as told:
        interface(name)
    assert f"install the package {name.partition('/')[0]}" in str(told.value)


def test_a_service_is_found_and_asked(domain: int) -> None:
    with Peer(domain) as peer:
        service: RemoteService = peer.bus.remote_service("std_srvs/srv/Trigger", "/late/answer")
        assert not service.ready
        with Peer(domain, name="late") as late:
            late.bus.serve_trigger("~/answer", lambda: "answered")
            told: list[Any] = []
            peer.until(lambda: service.ready)
            service.call({"fault_code": "of another service"}, told.append)
            late.until(lambda: peer.bus.wait_until(lambda: bool(told), 0.1))
            assert (told[0].success, told[0].message) == (True, "answered")
