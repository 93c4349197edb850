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

"""``flea model equations``: state equations, and the relations that run, with their numbers."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from flea_diag.tools.stand_option import chosen_stand

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.core.calibration.calibration import Calibration
    from flea_diag.core.residuals.relation_set import RelationSet


def equations(model: Actuator, arguments: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """State equations of each model, relations as drawn, and relations as they run."""
    states, lines = _state_equations(model, arguments)
    drawn = _drawn(model)
    calibration = _calibration(arguments)
    known = _compiled(model, arguments, calibration)
    run = {row.name: str(row.expression) for row in known.relations}
    numbers = _numbers(model, known, calibration)
    lines += ["Relations as drawn (d_x is the rate of x):"]
    lines += [f"  {name} = {words}" for name, words in drawn.items()]
    lines += ["", "Relations that run, in base parameters:"]
    lines += [f"  {row.name} = {row.expression}  [{row.unit}]" for row in known.relations]
    lines += [f"  {name} = {shape}" for name, shape in known.shapes.items()]
    predicted = {row.channel: str(row.rate) for row in known.predictions}
    lines += [f"  d {name}/dt = {rate}" for name, rate in predicted.items()]
    lines += [f"  {name}: predicted by {by}" for name, by in known.predicted.items()]
    lines += ["", _ends(model, known)]
    lines += ["", f"Base parameters, {_source(calibration)}:"]
    lines += [f"  {name} = {_said(row)}" for name, row in numbers.items()]
    tokens = ", ".join(f"{token} = {name}" for name, token in model.graph.tokens().items())
    content = {
        "models": states,
        "parity": drawn,
        "relations": run,
        "predictions": predicted,
        "base_parameters": numbers,
    }
    return content, [*lines, "", f"where {tokens}"]


def _state_equations(
    model: Actuator, arguments: argparse.Namespace
) -> tuple[dict[str, Any], list[str]]:
    tokens = model.graph.tokens()
    lines, content = [], {}
    for name in [arguments.model] if arguments.model else list(model.views):
        missing = [c for c in model.view(name).measured if c not in model.sensors]
        if missing:
            lines += [f"Model {name}: its input {missing[0]} is not among the sensors", ""]
            continue
        system = model.state_space(name)
        words = system.equations(tokens).splitlines()
        lines += [f"Model {name} (inputs {', '.join(system.inputs)}):"]
        lines += [*(f"  {word}" for word in words), ""]
        content[name] = {"states": system.states, "inputs": system.inputs, "equations": words}
    return content, lines


def _drawn(model: Actuator) -> dict[str, str]:
    from flea_diag.core.residuals.parity import parity_relation
    from flea_diag.errors import ModelError

    found = {}
    for name, spec in model.residuals.items():
        if spec.predicts:
            continue
        try:
            found[name] = str(parity_relation(model, spec).expression)
        except ModelError as error:
            found[name] = f"not closed: {error}"
    return found


def _calibration(arguments: argparse.Namespace) -> Calibration | None:
    from flea_diag.configuration.calibrations import learned

    return learned(_stand(arguments)) if arguments.calibration else None


def _stand(arguments: argparse.Namespace) -> Stand:
    return chosen_stand(arguments, "actuator", "calibration")


def _compiled(
    model: Actuator, arguments: argparse.Namespace, calibration: Calibration | None
) -> RelationSet:
    from flea_diag.configuration.knowledge import relations
    from flea_diag.core.residuals.relation_compiler import relation_set
    from flea_diag.core.residuals.residual_set import relation_names

    if calibration is not None:
        return relations(_stand(arguments), calibration)
    # Without a calibration nothing is a number yet: every parameter keeps its name.
    held = {*model.base_parameters, *model.graph.parameters} - set(model.predicted)
    return relation_set(model, relation_names(model), held, ())


def _numbers(
    model: Actuator, known: RelationSet, calibration: Calibration | None
) -> dict[str, dict[str, Any]]:
    """Base parameters that occur in the relations, with value, unit, error and definition."""
    from flea_diag.core.symbolic.expression import evaluate

    values = model.graph.values()
    found: dict[str, dict[str, Any]] = {}
    for name in known.parameters:
        definition = model.base_parameters.get(name)
        unit = model.base_units.get(name) or model.graph.parameters[name].unit
        row: dict[str, Any] = {"definition": str(definition or name), "unit": unit}
        row["value"] = float(evaluate(definition, values)) if definition else values[name]
        if calibration is not None:
            row["value"] = getattr(calibration.parameters, name)
            row["sigma"] = calibration.sigmas.get(name)
            row["not_identified"] = calibration.not_identified.get(name, "")
        found[name] = {key: entry for key, entry in row.items() if entry not in (None, "")}
    return found


def _ends(model: Actuator, known: RelationSet) -> str:
    """Where the hard stops are, and the relations that contact voids."""
    void, travel = ", ".join(known.stop.reactions) or "no relation", model.travel
    if travel is not None:
        turns = model.graph.elements[travel.at].domain == "rotation"
        ends = f"{travel.low_m:g} to {travel.high_m:g} {'rad' if turns else 'm'} at {travel.at}"
        return f"Travel: {ends}; contact with a stop voids {void}"
    channels = " or ".join(known.stop.channels)
    source = f"taken from the range of {channels}, if it has one, else " if channels else ""
    return (
        f"Travel: not stated, {source}unknown: then a run into a stop is taken for a fault; "
        f"contact with a stop voids {void}"
    )


def _source(calibration: Calibration | None) -> str:
    if calibration is None:
        return "values of the description"
    return f"calibrated on {calibration.nominal_s:.0f} s of nominal recordings"


def _said(row: dict[str, Any]) -> str:
    value = f"{row['value']:.5g}"
    if "sigma" in row:
        value += f" +- {row['sigma']:.2g}"
    value += "" if row["unit"] == "1" else f" {row['unit']}"
    reason = f"  (not identified: {row['not_identified']})" if "not_identified" in row else ""
    return f"{value}  {row['definition']}{reason}"
