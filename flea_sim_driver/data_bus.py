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

"""Commands that others publish while the stand runs, as the data bus of an aircraft does."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from flea_diag.wire.bus import Bus
from flea_sim_driver.scenario.live_command import FollowedValue
from flea_sim_driver.scenario.profile import commanded
from flea_sim_driver.scenario.scenario import Scenario
from flea_sim_driver.stand import Command

Array = npt.NDArray[np.float64]
FLOAT = "std_msgs/msg/Float64"
"""Type of a topic: position in m, or load in N."""


class DataBus:
    """Position and load of topics, each in place of the scenario's.

    Parameters
    ----------
    topics
        ``position`` and ``load``, each with the name of its topic; empty: the scenario's.
    silent_s
        Silence after which it is told.
    """

    def __init__(
        self, bus: Bus[Any], scenario: Scenario, topics: Mapping[str, str], silent_s: float
    ) -> None:
        self._scenario, self._silent_s = scenario, silent_s
        starts = [float(values[0]) for values in commanded(scenario, np.zeros(1))]
        limits, travel = scenario.machine.limits, scenario.travel
        reach = {
            "position": (travel.low_m, travel.high_m, limits.flight_speed_m_s),
            "load": (-limits.load_n, limits.load_n, limits.load_n),
        }
        self._followed: dict[str, FollowedValue] = {}
        self._taken: dict[str, int] = {}
        self._latest: dict[str, float] = {}
        for (name, topic), start in zip(topics.items(), starts, strict=True):
            if topic:
                self._followed[name], self._taken[name] = FollowedValue(start, *reach[name]), 0
                bus.subscribe_foreign(topic, FLOAT, partial(self._take, name))

    def _take(self, name: str, message: Any) -> None:
        if self._followed[name].take(message.data):
            self._taken[name] += 1
            self._latest[name] = time.monotonic()

    @property
    def command(self) -> Command | None:
        """What the stand is to follow; None: the scenario alone."""
        return self._block if self._followed else None

    def _block(self, time_s: Array) -> tuple[Array, Array]:
        of_scenario = commanded(self._scenario, time_s)
        position, load = (
            self._followed[name].block(len(time_s)) if name in self._followed else values
            for name, values in zip(("position", "load"), of_scenario, strict=True)
        )
        return position, load

    def wrong(self) -> list[str]:
        """Topics that are silent, in words."""
        return [words for name in self._followed if (words := self._silence(name))]

    def _silence(self, name: str) -> str:
        silent_s = time.monotonic() - self._latest.get(name, -math.inf)
        if silent_s < self._silent_s:
            return ""
        if silent_s == math.inf:
            return f"no {name} command yet: the start of the scenario is held"
        return f"no {name} command for {silent_s:.1f} s: the last one is held"

    def values(self) -> tuple[tuple[str, str], ...]:
        """What came of each topic, for the health of the node."""
        return tuple(
            (f"{name}_commands/{kind}", str(count))
            for name, followed in self._followed.items()
            for kind, count in (("taken", self._taken[name]), ("refused", followed.refused))
        )
