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

"""The model of one actuator: bond graph, sensors, views with measured inputs, residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated

from flea_diag.core.bond_graph.base_parameters import unit_of
from flea_diag.core.bond_graph.bond_graph import Bond, BondGraph
from flea_diag.core.bond_graph.causal_relation import (
    Relation,
    causal_relations,
    common_of,
    solve,
    with_measured,
)
from flea_diag.core.bond_graph.causality import Causality, require_sound
from flea_diag.core.bond_graph.graph_building import bond_graph
from flea_diag.core.bond_graph.modes import MachineMode
from flea_diag.core.bond_graph.state_space import StateSpace, state_space
from flea_diag.core.bond_graph.supplies import Supply
from flea_diag.core.bond_graph.tolerance import Tolerance
from flea_diag.core.bond_graph.travel import Travel
from flea_diag.core.scan_counts import SMOOTHING_S
from flea_diag.core.symbolic.expression import Expression, Variable, symbols
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.values import AboveZero, NotNegative, one_of

KINDS_OF_RESIDUAL = ("measurement", "junction", "difference", "prediction", "power")


@dataclass(frozen=True)
class Sensor:
    """One channel: the junction it is attached to, or the input that it reads (``at`` empty)."""

    channel: str
    at: str
    unit: str
    noise: AboveZero
    integrates: bool = False
    state: str = ""
    offset: str = ""
    """Parameter that the reading exceeds the variable by; empty: none."""

    @property
    def reading(self) -> Expression:
        """The variable (or its integral) by the reading."""
        channel = Variable(self.channel)
        return channel - Variable(self.offset) if self.offset else channel


@dataclass(frozen=True)
class ModelView:
    """A model with some channels as inputs; sensors may be attached to other junctions."""

    name: str
    measured: tuple[str, ...] = ()
    moved: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ResidualSpec:
    """One named residual; its kind determines which fields are used.

    A normalised residual is multiplied by the sign of the flow at junction ``motion``, or at its
    own junction if ``motion`` is empty. The two readings of a difference agree up to the
    parameters ``gain`` (of the reference) and ``offset``, to the share of its level that the
    supply ``supplied_by`` has (a bridge of given duty), and to what ``across`` takes between the
    places of the two: the displacement of a store, or the effort of a resistor. A balance, that
    of such a store too, leaves out the elements ``without``. A residual without ``signs`` is in no
    signature table. A prediction takes the stores ``lumped`` for one and the parameters
    ``neglected`` as 0. A power is summed over the bonds of ``junctions`` that lead out of them. A
    residual that ``settles_s`` is not formed for so long after a start, a stop or a reversal.
    """

    name: str
    kind: Annotated[str, one_of(*KINDS_OF_RESIDUAL)]
    unit: str
    channel: str = ""
    model: str = ""
    junction: str = ""
    reference: str = ""
    gain: str = ""
    offset: str = ""
    across: str = ""
    supplied_by: str = ""
    divided_by: str = ""
    without: tuple[str, ...] = ()
    normalised: bool = False
    motion: str = ""
    signs: bool = True
    lumped: tuple[str, ...] = ()
    neglected: tuple[str, ...] = ()
    junctions: tuple[str, ...] = ()
    settles_s: NotNegative = 0.0

    @property
    def balances(self) -> bool:
        """Whether it is a sum over bonds: at a junction, or of the power of several."""
        return self.kind in ("junction", "power")

    @property
    def pair(self) -> tuple[str, ...]:
        """Readings that a difference holds against each other, or one against a parameter."""
        read = (self.channel, self.reference) if self.kind == "difference" else ()
        return tuple(filter(None, read))

    @property
    def predicts(self) -> bool:
        """Whether it is a reading less what a model predicts for it."""
        return self.kind in ("measurement", "prediction")


@dataclass(frozen=True)
class OperatingPoint:
    """Magnitudes to hold, inputs or unsteady states that hold them, and values given directly."""

    hold: Mapping[str, float]
    by: tuple[str, ...]
    fixed: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Actuator:
    """Everything known about one actuator before the first sample."""

    name: str
    description: str
    scan_period_s: float
    graph: BondGraph
    sensors: Mapping[str, Sensor]
    inputs: Mapping[str, str]
    views: Mapping[str, ModelView]
    operating: OperatingPoint
    residuals: Mapping[str, ResidualSpec]
    base_parameters: Mapping[str, Expression] = field(default_factory=dict)
    """Names of what recordings can identify: products of powers of parameters."""
    predicted: Mapping[str, str] = field(default_factory=dict)
    """Parameter that a slow state sets scan by scan -> residual whose prediction gives it."""
    travel: Travel | None = None
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    """Base parameter -> by how much healthy units differ in it."""
    smoothing_s: float = SMOOTHING_S
    """Time over which readings are smoothed."""
    free_per_run: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Base parameters that any recording may have its own value of, such as a payload -> range."""
    modes: Mapping[str, MachineMode] = field(default_factory=dict)
    """Modes that a channel tells, by name."""
    supplies: Mapping[str, Supply] = field(default_factory=dict)
    """Supplies that a channel reads, by name."""

    @cached_property
    def causality(self) -> Causality:
        """Causality of the whole graph."""
        return solve(self.graph)[0]

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit of every channel and input."""
        told = {mode.channel: mode.unit for mode in self.modes.values()}
        return {**told, **self.inputs, **{s.channel: s.unit for s in self.sensors.values()}}

    @cached_property
    def base_units(self) -> dict[str, str]:
        """Unit of every base parameter: that of a torque or of a force, as the graph has it."""
        units = {name: entry.unit for name, entry in self.graph.parameters.items()}
        return {name: unit_of(row, units) for name, row in self.base_parameters.items()}

    @cached_property
    def fitted(self) -> tuple[str, ...]:
        """Base parameters of which none is assumed: no width, no constant of a material."""
        laws = ((e, self.graph.law(e)) for e in self.graph.elements.values())
        assumed = {
            name
            for element, law in laws
            if law is not None
            for role, name in element.parameters.items()
            if law.roles[role].assumed
        }
        rows = self.base_parameters.items()
        return tuple(name for name, row in rows if not assumed & set(symbols(row)))

    def relations(self, view: str = "stand") -> tuple[Relation, ...]:
        """Causal relations of a view of the model.

        Raises
        ------
        ModelError
            The causality of the graph is not sound.
        """
        if view not in self._by_view:
            self._by_view[view] = self._relations(view)
        return self._by_view[view]

    @cached_property
    def _by_view(self) -> dict[str, tuple[Relation, ...]]:
        return {}

    def _relations(self, view: str) -> tuple[Relation, ...]:
        model = self.view(view)
        graph = _moved(self.graph, model.moved)
        causality, _ = solve(graph)
        require_sound(graph, causality)
        measured = {c: (self.variable(c), self.sensors[c].reading) for c in model.measured}
        return with_measured(causal_relations(graph, causality), measured)

    def view(self, name: str) -> ModelView:
        """A view by name."""
        if name not in self.views:
            raise ConfigurationError(
                f"{self.name}: there is no model {shown(name)}, known are {', '.join(self.views)}"
            )
        return self.views[name]

    def variable(self, channel: str) -> str:
        """The effort or flow that a channel measures (of which it may be the integral)."""
        sensor = self.sensors[channel]
        if not sensor.at:
            return channel
        junction = self.graph.elements[sensor.at]
        return common_of(self.graph, junction, self.causality.effort_from)

    def state_space(self, view: str = "stand", outputs: Sequence[str] | None = None) -> StateSpace:
        """Equations of a view; outputs default to every channel that is not an input of it."""
        model = self.view(view)
        if outputs is None:
            outputs = [c for c, s in self.sensors.items() if s.at and c not in model.measured]
        where = f"{self.name}, model {view}"
        return state_space(self.relations(view), outputs, self.graph.values(), where)

    def with_parameters(self, values: Mapping[str, float]) -> Actuator:
        """The same actuator with other parameter values (a calibration), checked again."""
        unknown = sorted(set(values) - set(self.graph.parameters))
        if unknown:
            raise ConfigurationError(
                f"{self.name}: there is no parameter {shown(unknown[0])},"
                f" known are {', '.join(self.graph.parameters)}"
            )
        changed = tuple(
            replace(p, value=float(values.get(name, p.value)))
            for name, p in self.graph.parameters.items()
        )
        arrows = tuple((bond.tail, bond.head) for bond in self.graph.bonds)
        graph = bond_graph(self.name, tuple(self.graph.elements.values()), arrows, changed)
        return replace(self, graph=graph)

    def with_sensors(self, channels: Sequence[str]) -> Actuator:
        """The same actuator with only these sensors, and the residuals they allow."""
        unknown = sorted(set(channels) - set(self.sensors))
        if unknown:
            raise ConfigurationError(
                f"actuator {shown(self.name)} has no sensor {shown(unknown[0])},"
                f" known are {', '.join(self.sensors)}"
            )
        kept = {name: sensor for name, sensor in self.sensors.items() if name in channels}
        return replace(self, sensors=kept, residuals=self._possible(kept))

    def _possible(self, kept: Mapping[str, Sensor]) -> dict[str, ResidualSpec]:
        known = {*kept, *(name for name in self.inputs if name not in self.sensors)}
        return {
            name: spec
            for name, spec in self.residuals.items()
            if {spec.channel, spec.reference, *self._driven_by(spec)} - {""} <= known
        }

    def _driven_by(self, spec: ResidualSpec) -> tuple[str, ...]:
        return self.view(spec.model).measured if spec.model else ()


def _moved(graph: BondGraph, moved: Mapping[str, str]) -> BondGraph:
    if not moved:
        return graph
    bonds = tuple(
        Bond(b.name, moved.get(graph.elements[b.head].signal, b.tail), b.head) for b in graph.bonds
    )
    return replace(graph, bonds=bonds)
