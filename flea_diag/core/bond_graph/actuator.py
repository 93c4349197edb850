"""An actuator from its description, the mapping of ``config/stands/flea/actuator.yaml``.

The FLEA's graph (Narasimhan et al. 2010, Figure 5, with screw, load cell and thermal nodes)
is data. Any other actuator needs a description of its own and no code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flea_diag.core import schema
from flea_diag.core.bond_graph.actuator_model import (
    Actuator,
    ModelView,
    OperatingPoint,
    ResidualSpec,
    Sensor,
)
from flea_diag.core.bond_graph.base_parameters import base_parameters
from flea_diag.core.bond_graph.bond_graph import DOMAINS, BondGraph, Element, Parameter, bond_graph
from flea_diag.core.bond_graph.causality import require_sound
from flea_diag.core.bond_graph.described_residuals import check_residual, described_residuals
from flea_diag.core.bond_graph.tolerance import tolerances
from flea_diag.core.bond_graph.travel import travel
from flea_diag.core.schema import REQUIRED
from flea_diag.core.symbolic.unit import SECOND, dimension, spelled, times
from flea_diag.errors import ConfigurationError, shown
from flea_diag.formats import migrated

__all__ = ["Actuator", "ModelView", "OperatingPoint", "ResidualSpec", "Sensor", "actuator"]

_PARAMETER: schema.Keys = {
    "value": (float, REQUIRED),
    "unit": (str, REQUIRED),
    "symbol": (str, ""),
    "note": (str, ""),
}
_JUNCTION: schema.Keys = {"type": (str, REQUIRED), "domain": (str, REQUIRED)}
_ELEMENT: schema.Keys = {
    "type": (str, REQUIRED),
    "law": (str, ""),
    "parameters": (dict, {}),
    "signal": (str, ""),
    "state": (str, ""),
    "powers": (list, []),
    "modulated_by": (str, ""),
}
_SENSOR: schema.Keys = {
    "at": (str, REQUIRED),
    "unit": (str, REQUIRED),
    "noise": (float, REQUIRED),
    "integrates": (bool, False),
    "state": (str, ""),
    "offset": (str, ""),
}
_INPUT: schema.Keys = {"unit": (str, REQUIRED), "noise": (float, 0.0), "sensor": (bool, False)}
_VIEW: schema.Keys = {"measured": (list, []), "moved": (dict, {})}
_OPERATING: schema.Keys = {"hold": (dict, REQUIRED), "by": (list, REQUIRED), "fixed": (dict, {})}
_TOP: schema.Keys = {
    "name": (str, REQUIRED),
    "description": (str, ""),
    "scan_period_s": (float, REQUIRED),
    "parameters": (dict, REQUIRED),
    "junctions": (dict, REQUIRED),
    "elements": (dict, REQUIRED),
    "bonds": (list, REQUIRED),
    "sensors": (dict, REQUIRED),
    "inputs": (dict, REQUIRED),
    "models": (dict, {"stand": {}}),
    "operating_point": (dict, REQUIRED),
    "residuals": (dict, {}),
    "base_parameters": (dict, {}),
    "predicted": (dict, {}),
    "tolerances": (dict, {}),
    "travel": (dict, {}),
}
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
    top = schema.read(migrated("actuator description", content, where), where, _TOP)
    if not top["scan_period_s"] > 0:
        raise ConfigurationError(f"{where}: scan_period_s = {top['scan_period_s']} must be > 0")
    sensors, inputs = _sensors(top, where)
    parameters = tuple(
        Parameter(name, **schema.read(row, f"{where}: parameter {shown(name)}", _PARAMETER))
        for name, row in schema.rows(top["parameters"], f"{where}: parameters").items()
    )
    elements, arrows = _elements(top, where), _arrows(top, where)
    for sensor in sensors.values():
        if sensor.at:
            elements.append(_detector(sensor, elements, parameters, where))
            arrows.append((sensor.at, elements[-1].name))
    graph = bond_graph(top["name"], tuple(elements), tuple(arrows), parameters)
    result = Actuator(
        top["name"],
        top["description"],
        top["scan_period_s"],
        graph,
        sensors,
        inputs,
        _views(top, sensors, graph, where),
        _operating(top, where),
        described_residuals(top, where),
        base_parameters(top["base_parameters"], graph.parameters, f"{where}: base_parameters"),
        schema.pairs(top["predicted"], f"{where}: predicted"),
        travel(top["travel"], graph, {s.at for s in sensors.values() if s.integrates}, where),
        tolerances(top["tolerances"], (*top["base_parameters"], HEATING), f"{where}: tolerances"),
    )
    if sound:
        _check(result, where)
    return result


def _elements(top: Mapping[str, Any], where: str) -> list[Element]:
    found = []
    for name, row in schema.rows(top["junctions"], f"{where}: junctions").items():
        values = schema.read(row, f"{where}: junction {shown(name)}", _JUNCTION)
        found.append(Element(name, values["type"], values["domain"]))
    for name, row in schema.rows(top["elements"], f"{where}: elements").items():
        place = f"{where}: element {shown(name)}"
        values = schema.read(row, place, _ELEMENT)
        roles = schema.pairs(values.pop("parameters"), f"{place}: parameters")
        powers = schema.texts(values.pop("powers"), f"{place}: powers")
        found.append(Element(name, values.pop("type"), parameters=roles, powers=powers, **values))
    return found


def _arrows(top: Mapping[str, Any], where: str) -> list[tuple[str, str]]:
    found = []
    for bond in schema.texts(top["bonds"], f"{where}: bonds"):
        ends = [end.strip() for end in bond.split("->")]
        if len(ends) != 2 or not all(ends):
            raise ConfigurationError(f"{where}: bond {shown(bond)} must be written 'tail -> head'")
        found.append((ends[0], ends[1]))
    return found


def _sensors(top: Mapping[str, Any], where: str) -> tuple[dict[str, Sensor], dict[str, str]]:
    sensors, inputs = {}, {}
    for name, row in schema.rows(top["sensors"], f"{where}: sensors").items():
        values = schema.read(row, f"{where}: sensor {shown(name)}", _SENSOR)
        sensors[name] = Sensor(name, **values)
    for name, row in schema.rows(top["inputs"], f"{where}: inputs").items():
        values = schema.read(row, f"{where}: input {shown(name)}", _INPUT)
        inputs[name] = values["unit"]
        if values["sensor"]:
            sensors[name] = Sensor(name, "", values["unit"], values["noise"])
    for sensor in sensors.values():
        dimension(sensor.unit)
        if not sensor.noise > 0:
            raise ConfigurationError(
                f"{where}: sensor {shown(sensor.channel)}, noise = {sensor.noise} must be > 0"
            )
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
    top: Mapping[str, Any], sensors: Mapping[str, Sensor], graph: BondGraph, where: str
) -> dict[str, ModelView]:
    found = {"stand": ModelView("stand", (), {})}
    for name, row in schema.rows(top["models"], f"{where}: models").items():
        place = f"{where}: model {shown(name)}"
        values = schema.read(row, place, _VIEW)
        measured = schema.texts(values["measured"], f"{place}: measured")
        moved = schema.pairs(values["moved"], f"{place}: moved")
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
        found[name] = ModelView(name, measured, moved)
    return found


def _operating(top: Mapping[str, Any], where: str) -> OperatingPoint:
    place = f"{where}: operating_point"
    values = schema.read(top["operating_point"], place, _OPERATING)
    by = schema.texts(values["by"], f"{place}: by")
    hold = schema.numbers(values["hold"], f"{place}: hold")
    if len(by) != len(hold) or not hold:
        raise ConfigurationError(
            f"{place} holds {len(hold)} values by {len(by)} inputs; give one input for each value"
        )
    return OperatingPoint(hold, by, schema.numbers(values["fixed"], f"{place}: fixed"))


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
