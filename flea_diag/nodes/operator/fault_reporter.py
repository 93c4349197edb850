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

"""``ros2 run flea_diag fault_reporter``: reports verdicts to the fault manager of ros2_medkit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flea_diag.nodes.health import HealthReport
from flea_diag.operator.fault_report import FaultReport, fault_report
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import AmbiguityGroup, Health

REPEAT_S = 1.0


@dataclass(frozen=True)
class FaultReporterParameters:
    """Parameters of the fault reporter."""

    service: str = parameter(
        "/fault_manager/report_fault", "service of the fault manager", read_only=True
    )
    type: str = parameter(
        "ros2_medkit_msgs/srv/ReportFault", "type of that service, looked up at start",
        read_only=True,
    )  # fmt: skip


class FaultReporter:
    """Reports each change of the verdict: the earlier fault passed, the present one failed.

    What changes while no fault manager is there, or is refused by it, is reported a second later.
    """

    def __init__(self, bus: Bus[Any], parameters: FaultReporterParameters) -> None:
        self._bus = bus
        self._service = bus.remote_service(parameters.type, parameters.service)
        self._health = HealthReport(bus)
        self._wanted: FaultReport | None = None
        self._told: FaultReport | None = None
        self._pending: FaultReport | None = None
        bus.advertise(Health)
        bus.subscribe(AmbiguityGroup, self._take)
        bus.every(REPEAT_S, self._repeat)
        bus.info(f"reporting verdicts of {bus.full_name(AmbiguityGroup)} to {parameters.service}")

    def _take(self, group: AmbiguityGroup) -> None:
        self._health.taken()
        if not group.stale:
            self._wanted = fault_report(group, self._bus.stand)
        self._report()

    def _repeat(self) -> None:
        self._pending = None
        self._report()
        reported = self._told.fault_code if self._told is not None else ""
        self._bus.publish(self._health.record((("reported", reported),)))

    def _report(self) -> None:
        """Send the next report that is due, one at a time."""
        if self._pending is not None or not self._service.ready:
            return
        wanted, told = self._wanted, self._told
        if told is not None and (wanted is None or wanted.fault_code != told.fault_code):
            self._send(told.passed(), None)
        elif wanted is not None and told is None:
            self._send(wanted, wanted)

    def _send(self, report: FaultReport, told: FaultReport | None) -> None:
        self._pending = report
        request = {
            "fault_code": report.fault_code,
            "event_type": report.event_type,
            "severity": report.severity,
            "description": report.description,
            "source_id": f"/{self._bus.name}",
            "evidence": [{"key": key, "value": value} for key, value in report.evidence],
        }
        self._service.call(request, lambda response: self._answered(report, told, response))

    def _answered(self, report: FaultReport, told: FaultReport | None, response: Any) -> None:
        if self._pending is not report:
            return
        if not response.accepted:
            self._bus.warn(f"{report.fault_code} was not accepted by the fault manager")
            return
        self._pending, self._told = None, told
        self._report()


def program() -> Program:
    """Description of this node."""

    def start(bus: Bus[Any], parameters: FaultReporterParameters) -> None:
        FaultReporter(bus, parameters)

    return Program(
        "fault_reporter",
        "Reports the faults of the verdict to the fault manager of ros2_medkit.",
        FaultReporterParameters,
        start,
        subscribes=(AmbiguityGroup,),
        publishes=(Health,),
        examples=(
            "ros2 run flea_diag fault_reporter",
            "ros2 run flea_diag fault_reporter --ros-args -r __ns:=/stand_2",
        ),
    )
