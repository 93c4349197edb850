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

"""Initial signatures in continuous time, by forward propagation on the temporal causal graph."""

from __future__ import annotations

from collections.abc import Mapping

from flea_diag.core.bond_graph.actuator_model import Actuator, ResidualSpec
from flea_diag.core.causal_graph.operating_point import rates
from flea_diag.core.causal_graph.propagation import (
    MAX_ORDER,
    Effect,
    InitialDeviation,
    combined,
    initial_deviations,
    propagate_forward,
    scaled,
)
from flea_diag.core.causal_graph.temporal_causal_graph import (
    TemporalCausalGraph,
    temporal_causal_graph,
)
from flea_diag.core.faults.fault import Alternative, Fault
from flea_diag.core.faults.fault_signature import FaultSignature, signature
from flea_diag.core.residuals.parity import ParityRelation, parity_relation
from flea_diag.core.signatures.parity_signature import parity_cell, sensor_signs


class TextbookColumns:
    """Cells of the continuous-time table of one actuator at one operating point."""

    def __init__(self, model: Actuator, values: Mapping[str, float]) -> None:
        self.model = model
        self.values = values
        self.rates = rates(model, dict(values))
        self.relations: dict[str, ParityRelation] = {}
        self.graphs: dict[str, TemporalCausalGraph] = {}
        self.effects: dict[tuple[str, tuple[InitialDeviation, ...]], dict[str, Effect]] = {}

    def cell(self, spec: ResidualSpec, fault: Fault, group: Alternative) -> FaultSignature:
        """Signature of one alternative in one residual."""
        if spec.balances or spec.supplied_by:
            return parity_cell(self._relation(spec), fault, group, self.values, self.rates)
        if spec.predicts:
            return self._measurement(spec.channel, spec.model, fault, group)
        one = self._measurement(spec.channel, "stand", fault, group)
        if spec.reference not in self.model.sensors:
            return one
        other = self._measurement(spec.reference, "stand", fault, group)
        return _difference(one, other)

    def _measurement(
        self, channel: str, view: str, fault: Fault, group: Alternative
    ) -> FaultSignature:
        graph = self._graph(view)
        entering: list[InitialDeviation] = []
        own, path = "0" * (MAX_ORDER + 1), ""
        for cause in group:
            if not cause.mode:
                entering += initial_deviations(graph, cause, self.values, fault.incipient)
                continue
            signs = sensor_signs(cause, self.values[cause.name], self.rates.get(cause.name, 0.0))
            if cause.name == channel:
                own, path = signs.ljust(MAX_ORDER + 1, "0"), f"{cause} -> {channel}"
            if cause.name in graph.inputs:
                # The prediction follows the faulty reading, so y - prediction moves against it.
                entering += [
                    InitialDeviation(cause.name, k, scaled(s, -1), str(cause))
                    for k, s in enumerate(signs)
                ]
        effect = self._effects(view, tuple(entering))[channel]
        signs = "".join(combined(pair) for pair in zip(own, effect.signs, strict=True))
        return signature(signs, path or effect.path)

    def _effects(self, view: str, entering: tuple[InitialDeviation, ...]) -> dict[str, Effect]:
        key = (view, entering)
        if key not in self.effects:
            self.effects[key] = propagate_forward(self._graph(view), entering, self.values)
        return self.effects[key]

    def _graph(self, view: str) -> TemporalCausalGraph:
        if view not in self.graphs:
            relations = self.model.relations(view)
            self.graphs[view] = temporal_causal_graph(relations, self.model.graph.parameters)
        return self.graphs[view]

    def _relation(self, spec: ResidualSpec) -> ParityRelation:
        if spec.name not in self.relations:
            self.relations[spec.name] = parity_relation(self.model, spec)
        return self.relations[spec.name]


def _difference(one: FaultSignature, other: FaultSignature) -> FaultSignature:
    width = MAX_ORDER + 1
    left, right = (s.derivatives.ljust(width, "0") for s in (one, other))
    signs = "".join(combined((a, scaled(b, -1))) for a, b in zip(left, right, strict=True))
    return signature(signs, " and ".join(p for p in (one.path, other.path) if p))
