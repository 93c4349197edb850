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

"""``ros2 run flea_diag typed_verdict``: the verdict as a message of flea_diag_msgs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flea_diag.nodes.health import HealthReport
from flea_diag.wire.bus import Bus, Program
from flea_diag.wire.messages.typed_verdict import TYPE, VERDICT, typed_verdict
from flea_diag.wire.parameters import parameter
from flea_diag.wire.records import AmbiguityGroup, Health, Hypotheses

REPORT_S = 1.0


@dataclass(frozen=True)
class TypedVerdictParameters:
    """Parameters of the node of typed verdicts."""

    type: str = parameter(TYPE, "type of the message, looked up at start", read_only=True)


class TypedVerdict:
    """Publishes each verdict once more, with its hypotheses as soon as they have come."""

    def __init__(self, bus: Bus[Any], parameters: TypedVerdictParameters) -> None:
        self._bus = bus
        self._health = HealthReport(bus)
        self._publish = bus.advertise_foreign(VERDICT, parameters.type)
        self._group: AmbiguityGroup | None = None
        self._hypotheses: Hypotheses | None = None
        bus.advertise(Health)
        bus.subscribe(AmbiguityGroup, self._take)
        bus.subscribe(Hypotheses, self._complete)
        bus.every(REPORT_S, lambda: bus.publish(self._health.record(())))
        bus.info(f"verdicts of {bus.full_name(AmbiguityGroup)} as {parameters.type} on {VERDICT}")

    def _take(self, group: AmbiguityGroup) -> None:
        self._health.taken()
        self._group = group
        self._say()

    def _complete(self, hypotheses: Hypotheses) -> None:
        self._hypotheses = hypotheses
        if self._group is not None and self._group.verdict == hypotheses.verdict:
            self._say()

    def _say(self) -> None:
        assert self._group is not None
        self._publish(typed_verdict(self._group.with_hypotheses(self._hypotheses)))


def program() -> Program:
    """Description of this node."""

    def start(bus: Bus[Any], parameters: TypedVerdictParameters) -> None:
        TypedVerdict(bus, parameters)

    return Program(
        "typed_verdict",
        f"Publishes the verdict on {VERDICT} as {TYPE}, where that package is installed.",
        TypedVerdictParameters,
        start,
        subscribes=(AmbiguityGroup, Hypotheses),
        publishes=(Health,),
        examples=(
            "ros2 run flea_diag typed_verdict",
            "ros2 run flea_diag typed_verdict --ros-args -r __ns:=/stand_2",
        ),
    )
