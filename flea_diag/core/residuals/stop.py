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

"""The one-sided stops at the ends of travel, and the relations that their reaction enters.

In contact the reaction of a stop is an effort that nothing measures. It is drawn into the graph
as a source at the junction of the moved part; the relations that then hold it are void in contact,
and their derivative with respect to it turns a residual into the reaction that it misses.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.bond_graph.bond_graph import Element
from flea_diag.core.bond_graph.graph_building import bond_graph
from flea_diag.core.bond_graph.travel import WITHIN
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.parity import parity_relation
from flea_diag.core.symbolic.expression import ZERO, derivative, evaluate, symbols

Array = npt.NDArray[np.float64]

REACTION = "stop_reaction"
"""Signal of the source that stands for the stop; positive where it opposes a positive flow."""


@dataclass(frozen=True)
class Stop(Frozen):
    """Ends of travel, NaN where not stated, and what tells of contact.

    ``channels`` read the displacement of the stopped part; ``reactions`` maps each relation that
    the reaction enters to d r / d reaction, NaN where that varies with the signals (a power).
    """

    low_m: float = math.nan
    high_m: float = math.nan
    within_m: float = math.nan
    channels: tuple[str, ...] = ()
    reactions: Mapping[str, float] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """Whether the ends are known and a channel reads where the part is."""
        return bool(self.channels) and self.low_m < self.high_m

    @property
    def needed(self) -> dict[str, frozenset[str]]:
        """Channel -> relations that are void without it: nothing else tells where the part is."""
        alone = self.channels if self.known and len(self.channels) == 1 else ()
        return {channel: frozenset(self.reactions) for channel in alone}

    def near(self, places: Array) -> npt.NDArray[np.bool_]:
        """Whether the stopped part is within an end, shape (n,); nowhere where none is stated."""
        low, high = self.low_m + self.within_m, self.high_m - self.within_m
        return np.asarray((places <= low) | (places >= high))

    def contradicts(self, side: int) -> dict[str, str]:
        """Sign of each balance that contact with the lower (-1) or upper (1) stop never gives.

        A stop pushes back only, so it moves a balance to one side.
        """
        fixed = {name: gain for name, gain in self.reactions.items() if math.isfinite(gain)}
        return {name: "+" if gain * side > 0.0 else "-" for name, gain in fixed.items()}

    def within(self, ranges: Mapping[str, tuple[float, float]]) -> Stop:
        """The same, with ends that were not stated taken from the narrowest range of a channel."""
        stated = [ranges[channel] for channel in self.channels if channel in ranges]
        spans = [(high - low, low, high) for low, high in stated if low < high]
        span, low, high = min(spans, default=(math.inf, 0.0, 0.0))
        if self.low_m < self.high_m or math.isinf(span):
            return self
        return replace(self, low_m=low, high_m=high, within_m=WITHIN * span)


def stop_of(actuator: Actuator, relations: Iterable[str]) -> Stop:
    """The stops of an actuator, for those of its named relations that are compiled."""
    displaced = [s for s in actuator.sensors.values() if s.integrates]
    travel = actuator.travel
    at = travel.at if travel else next((s.at for s in displaced), "")
    if at not in actuator.graph.elements or actuator.graph.elements[at].kind != "1":
        return Stop()
    moved = {c: place for view in actuator.views.values() for c, place in view.moved.items()}
    channels = tuple(s.channel for s in displaced if at in (s.at, moved.get(s.channel)))
    reactions = MappingProxyType(reactions_at(actuator, at, relations))
    if travel is None:
        return Stop(channels=channels, reactions=reactions)
    return Stop(travel.low_m, travel.high_m, travel.within_m, channels, reactions)


def reactions_at(actuator: Actuator, at: str, relations: Iterable[str]) -> dict[str, float]:
    """Relation -> d r / d effort of what holds the flow of a junction, NaN where that varies."""
    stopped, found = _stopped(actuator, at), {}
    for name in relations:
        relation = parity_relation(stopped, actuator.residuals[name])
        gain = derivative(relation.expression, REACTION)
        if gain != ZERO:
            fixed = set(symbols(gain)) <= set(relation.nominal)
            found[name] = float(evaluate(gain, relation.nominal)) if fixed else math.nan
    return found


def _stopped(actuator: Actuator, at: str) -> Actuator:
    """The actuator with the reaction of a stop at a junction."""
    graph = actuator.graph
    elements = (*graph.elements.values(), Element("end_stop", "MSe", signal=REACTION))
    arrows = (*((bond.tail, bond.head) for bond in graph.bonds), (at, "end_stop"))
    parameters = tuple(graph.parameters.values())
    return replace(actuator, graph=bond_graph(actuator.name, elements, arrows, parameters))
