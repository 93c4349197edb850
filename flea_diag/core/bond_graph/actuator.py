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

"""An actuator from its description, the mapping of ``config/stands/flea/actuator.yaml``.

The FLEA's graph (Narasimhan et al. 2010, Figure 5, with screw, load cell and thermal nodes)
is data. Any other actuator needs a description of its own and no code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from flea_diag.core.bond_graph.actuator_model import (
    Actuator,
    ModelView,
    OperatingPoint,
    ResidualSpec,
    Sensor,
)
from flea_diag.core.bond_graph.base_parameters import base_parameters
from flea_diag.core.bond_graph.bond_graph import DOMAINS, BondGraph, Element, Parameter
from flea_diag.core.bond_graph.causality import require_sound
from flea_diag.core.bond_graph.described_residuals import check_residual, described_residuals
from flea_diag.core.bond_graph.graph_building import bond_graph
from flea_diag.core.bond_graph.modes import modes
from flea_diag.core.bond_graph.supplies import supplies
from flea_diag.core.bond_graph.tolerance import free_per_run, tolerances
from flea_diag.core.bond_graph.travel import travel
from flea_diag.core.scan_counts import SMOOTHING_S, SMOOTHINGS_S
from flea_diag.core.symbolic.expression import Expression, evaluate
from flea_diag.core.symbolic.unit import SECOND, dimension, spelled, times
from flea_diag.errors import ConfigurationError, shown
from flea_diag.fields.reader import read_as
from flea_diag.fields.values import AboveZero, within
from flea_diag.formats import migrated

__all__ = ["Actuator", "ModelView", "OperatingPoint", "ResidualSpec", "Sensor", "actuator"]

HEATING = "thermal_rate_k_per_s"
"""A tolerance that is of no parameter: of what heats a store beside its equation."""


def actuator(content: Any, where: str = "actuator.yaml", *, sound: bool = True) -> Actuator:
    """Build an actuator from its description; ``sound=False`` skips the causality check.

    Raises
    ------
    ConfigurationError
        Unknown key, name or unit, or a value out of range; the message names it.
    ModelError
        The graph is not a valid bond graph, or its causality is not sound.
    """
    top = read_as(_Description, migrated("actuator description", content, where), where)
    sensors, inputs = _sensors(top, where)
    parameters = tuple(
        read_as(Parameter, row, f"{where}: parameter {shown(name)}", given={"name": name})
        for name, row in top.parameters.items()
    )
    elements, arrows = _elements(top, where), _arrows(top, where)
    for sensor in sensors.values():
        if sensor.at:
            elements.append(_detector(sensor, elements, parameters, where))
            arrows.append((sensor.at, elements[-1].name))
    graph = bond_graph(top.name, tuple(elements), tuple(arrows), parameters)
    units = {name: sensor.unit for name, sensor in sensors.items()}
    residuals = described_residuals(top.residuals, where)
    base = base_parameters(top.base_parameters, graph.parameters, f"{where}: base_parameters")
    result = Actuator(
        top.name,
        top.description,
        top.scan_period_s,
        graph,
        sensors,
        inputs,
        _views(top, sensors, graph, where),
        _operating(top, where),
        residuals,
        base,
        top.predicted,
        travel(top.travel, graph, {s.at for s in sensors.values() if s.integrates}, where),
        tolerances(top.tolerances, (*top.base_parameters, HEATING), f"{where}: tolerances"),
        top.smoothing_s,
        free_per_run(top.free_per_run, _base_values(graph, base), f"{where}: free_per_run"),
        modes(top.modes, graph, inputs | units, top.residuals, where),
        supplies(top.supplies, sensors, _held(residuals), graph.values(), where),
    )
    if sound:
        _check(result, where)
    return result


def _base_values(graph: BondGraph, base: Mapping[str, Expression]) -> dict[str, float]:
    """Base parameters with the values that the description gives them."""
    values = graph.values()
    return {name: float(evaluate(product, values)) for name, product in base.items()}


def _held(residuals: Mapping[str, ResidualSpec]) -> dict[str, tuple[str, str]]:
    """Channel -> residual that holds it against a parameter alone, and that parameter."""
    alone = (spec for spec in residuals.values() if len(spec.pair) == 1)
    return {spec.channel: (spec.name, spec.offset) for spec in alone}


@dataclass(frozen=True)
class _Description:
    """The whole file; rows are read where their names are known."""

    name: str
    scan_period_s: AboveZero
    parameters: Mapping[str, Any]
    junctions: Mapping[str, Any]
    elements: Mapping[str, Any]
    bonds: tuple[str, ...]
    sensors: Mapping[str, Any]
    inputs: Mapping[str, Any]
    operating_point: OperatingPoint
    description: str = ""
    models: Mapping[str, Any] = field(default_factory=dict)
    residuals: Mapping[str, Any] = field(default_factory=dict)
    base_parameters: Mapping[str, str] = field(default_factory=dict)
    predicted: Mapping[str, str] = field(default_factory=dict)
    tolerances: Mapping[str, Any] = field(default_factory=dict)
    travel: Mapping[str, Any] = field(default_factory=dict)
    smoothing_s: Annotated[float, within(*SMOOTHINGS_S)] = SMOOTHING_S
    free_per_run: Any = ()
    modes: Mapping[str, Any] = field(default_factory=dict)
    supplies: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Junction:
    type: str
    domain: str


@dataclass(frozen=True)
class _Input:
    unit: str
    noise: float = 0.0
    sensor: bool = False


def _elements(top: _Description, where: str) -> list[Element]:
    found = []
    for name, row in top.junctions.items():
        junction = read_as(_Junction, row, f"{where}: junction {shown(name)}")
        found.append(Element(name, junction.type, junction.domain))
    for name, row in top.elements.items():
        given = {"name": name, "domain": "", "integrates": False}
        found.append(read_as(Element, row, f"{where}: element {shown(name)}", given=given))
    return found


def _arrows(top: _Description, where: str) -> list[tuple[str, str]]:
    found = []
    for bond in top.bonds:
        ends = [end.strip() for end in bond.split("->")]
        if len(ends) != 2 or not all(ends):
            raise ConfigurationError(f"{where}: bond {shown(bond)} must be written 'tail -> head'")
        found.append((ends[0], ends[1]))
    return found


def _sensors(top: _Description, where: str) -> tuple[dict[str, Sensor], dict[str, str]]:
    sensors, inputs = {}, {}
    for name, row in top.sensors.items():
        place = f"{where}: sensor {shown(name)}"
        sensors[name] = read_as(Sensor, row, place, given={"channel": name})
    for name, row in top.inputs.items():
        known = read_as(_Input, row, f"{where}: input {shown(name)}")
        inputs[name] = known.unit
        if known.sensor:
            if not known.noise > 0.0:
                raise ConfigurationError(f"{where}: input {shown(name)}: noise must be above 0")
            sensors[name] = Sensor(name, "", known.unit, known.noise)
    for sensor in sensors.values():
        dimension(sensor.unit)
    return sensors, inputs


def _detector(
    sensor: Sensor, elements: list[Element], parameters: Sequence[Parameter], where: str
) -> Element:
    place = next((e for e in elements if e.name == sensor.at and e.kind in ("0", "1")), None)
    if place is None:
        raise ConfigurationError(
            f"{where}: sensor {shown(sensor.channel)} is at {shown(sensor.at)}, which is no "
            "junction; attach it to one"
        )
    _check_sensor_unit(sensor, place, where)
    _check_offset(sensor, parameters, where)
    return Element(
        f"{sensor.channel}_sensor",
        "De" if place.kind == "0" else "Df",
        signal=sensor.channel,
        state=sensor.state,
        integrates=sensor.integrates,
        parameters={"offset": sensor.offset} if sensor.offset else {},
    )


def _check_offset(sensor: Sensor, parameters: Sequence[Parameter], where: str) -> None:
    if not sensor.offset:
        return
    unit = next((p.unit for p in parameters if p.name == sensor.offset), "")
    if not unit or dimension(unit) != dimension(sensor.unit):
        raise ConfigurationError(
            f"{where}: sensor {shown(sensor.channel)} has offset {shown(sensor.offset)}, which is"
            f" {'in ' + unit if unit else 'no parameter'}; name a parameter in {sensor.unit}"
        )


def _check_sensor_unit(sensor: Sensor, place: Element, where: str) -> None:
    if place.domain not in DOMAINS:
        return
    wanted = dimension(DOMAINS[place.domain][0 if place.kind == "0" else 1])
    wanted = times(wanted, SECOND) if sensor.integrates else wanted
    if dimension(sensor.unit) != wanted:
        raise ConfigurationError(
            f"{where}: sensor {shown(sensor.channel)} has unit {shown(sensor.unit)},"
            f" at {shown(sensor.at)} it reads {spelled(wanted)}; correct unit or place"
        )


def _views(
    top: _Description, sensors: Mapping[str, Sensor], graph: BondGraph, where: str
) -> dict[str, ModelView]:
    found = {"stand": ModelView("stand", (), {})}
    for name, row in top.models.items():
        place = f"{where}: model {shown(name)}"
        view = read_as(ModelView, row, place, given={"name": name})
        measured, moved = view.measured, view.moved
        for channel in (*measured, *moved):
            if channel not in sensors or not sensors[channel].at:
                raise ConfigurationError(f"{place}: {shown(channel)} is no sensor of the graph")
            if channel in measured and sensors[channel].integrates:
                raise ConfigurationError(
                    f"{place}: {shown(channel)} is an integral; an input must be an effort or a "
                    "flow"
                )
        for junction in moved.values():
            if junction not in graph.elements:
                raise ConfigurationError(
                    f"{place}: there is no junction {shown(junction)} to move to"
                )
        found[name] = view
    return found


def _operating(top: _Description, where: str) -> OperatingPoint:
    hold, by = top.operating_point.hold, top.operating_point.by
    if len(by) != len(hold) or not hold:
        raise ConfigurationError(
            f"{where}: operating_point holds {len(hold)} values by {len(by)} inputs; give one input"
            " for each value"
        )
    return top.operating_point


def _check_operating(made: Actuator, where: str) -> None:
    states = {element.state for element in made.graph.elements.values()}
    integrals = {sensor.state for sensor in made.sensors.values()}
    by = {*made.inputs, *states, *integrals} - {""}
    held = made.operating
    for known, names, what in (
        (set(made.sensors), held.hold, "channel"), (by, held.by, "input or state")
    ):  # fmt: skip
        for name in names:
            if name not in known:
                raise ConfigurationError(
                    f"{where}: operating_point names {shown(name)}, no {what}; known are"
                    f" {', '.join(sorted(known))}"
                )


def _check(made: Actuator, where: str) -> None:
    require_sound(made.graph, made.causality)
    fed = {e.signal for e in made.graph.elements.values() if e.kind in ("Se", "Sf", "MSe", "MSf")}
    for name in sorted((fed - {""}) ^ set(made.inputs)):
        said = "is an input that no source uses" if name in made.inputs else "is used but no input"
        raise ConfigurationError(f"{where}: {shown(name)} {said}; make inputs and sources agree")
    _check_operating(made, where)
    for spec in made.residuals.values():
        check_residual(made, spec, where)
    for parameter, residual in made.predicted.items():
        if parameter not in made.graph.parameters or residual not in made.residuals:
            raise ConfigurationError(
                f"{where}: predicted: {shown(parameter)} must be a parameter and"
                f" {shown(residual)} a residual"
            )
