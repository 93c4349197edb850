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

"""The views of ``flea model``: each returns its content for JSON and as lines of text."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from flea_diag.errors import ConfigurationError
from flea_diag.tools.model.equations import equations
from flea_diag.tools.stand_option import chosen_stand

if TYPE_CHECKING:
    from flea_diag.configuration.stand import Stand
    from flea_diag.core.bond_graph.actuator_model import Actuator
    from flea_diag.core.causal_graph.operating_point import Quadrant
    from flea_diag.core.faults.fault import Fault
    from flea_diag.core.signatures.diagnosability import Diagnosability

View = tuple[dict[str, Any], list[str]]


def _show(model: Actuator, arguments: argparse.Namespace) -> View:
    graph, causality = model.graph, model.causality
    counts = ", ".join(f"{len(graph.of_kind(k))} {k}" for k in _kinds(model))
    rows = [
        f"  {p.name} = {p.value:g} {p.unit}" + (f"  ({p.note})" if p.note else "")
        for p in graph.parameters.values()
    ]
    lines = [f"{model.name}: {model.description}", f"{len(graph.bonds)} bonds, {counts}", ""]
    lines += [f"  {b.tail} -> {b.head}" for b in graph.bonds]
    lines += ["", "Parameters:", *rows, "", "Causality:", causality.report()]
    content = {
        "name": model.name,
        "bonds": [[b.tail, b.head] for b in graph.bonds],
        "parameters": {n: {"value": p.value, "unit": p.unit} for n, p in graph.parameters.items()},
        "effort_from": dict(causality.effort_from),
        "sound": causality.sound,
        "steps": list(causality.steps),
    }
    return content, lines


def _kinds(model: Actuator) -> list[str]:
    return list(dict.fromkeys(element.kind for element in model.graph.elements.values()))


def _tcg(model: Actuator, arguments: argparse.Namespace) -> View:
    from flea_diag.core.causal_graph.operating_point import operating_values
    from flea_diag.core.causal_graph.propagation import propagate_backward

    graph = causal_graph(model, arguments)
    measurement = getattr(arguments, "from")
    if not measurement:
        lines = list(graph.lines(model.graph.tokens()))
        return {"edges": lines}, lines
    channel, sign = measurement[:-1], measurement[-1]
    if channel not in graph.vertices or sign not in "+-":
        raise ConfigurationError(
            f"--from {measurement} must be a channel with a sign, such as motor_speed-"
        )
    lines, content = [], {}
    for quadrant in _quadrants(arguments):
        values = operating_values(model, quadrant)
        found = propagate_backward(graph, channel, sign, values, arguments.complete)
        lines += [f"{channel}{sign} at {quadrant}:", *_indent(map(str, found))]
        content[str(quadrant)] = [{"hypothesis": str(s.hypothesis), "path": s.path} for s in found]
    return content, lines


def causal_graph(model: Actuator, arguments: argparse.Namespace) -> Any:
    """Temporal causal graph of the chosen model."""
    from flea_diag.core.causal_graph.temporal_causal_graph import temporal_causal_graph

    return temporal_causal_graph(
        model.relations(arguments.model or "stand"), model.graph.parameters
    )


def _signatures(model: Actuator, arguments: argparse.Namespace) -> View:
    from flea_diag.core.signatures.signature import signature_table

    faults, names = _faults(model, arguments), _residuals(model)
    lines, content = [], {}
    for quadrant in _quadrants(arguments):
        table = signature_table(model, faults, names, quadrant, _period(arguments))
        what = f"at {arguments.rate:g} Hz" if arguments.rate else "initial (textbook)"
        lines += [f"Signatures {what}, {quadrant}: magnitude, slope (order)", ""]
        rows = [[fault, *(str(row[n]) for n in names)] for fault, row in table.items()]
        lines += [*_columns([["fault", *names], *rows]), ""]
        content[str(quadrant)] = {
            fault: {n: {"symbols": row[n].symbols, "path": row[n].path} for n in names}
            for fault, row in table.items()
        }
    return content, lines


def _diagnosability(model: Actuator, arguments: argparse.Namespace) -> View:
    from flea_diag.core.signatures.diagnosability import diagnosability
    from flea_diag.tools.model.features import in_words, never_split

    faults = _faults(model, arguments)
    period = _period(arguments) or model.scan_period_s
    quadrants = _quadrants(arguments)
    found = diagnosability(model, faults, _residuals(model), period, quadrants)
    lines = [f"Sensors: {', '.join(model.sensors)}", f"Residuals: {', '.join(found.residuals)}", ""]
    lines += ["Not separable by these residuals in any operating state (identical signatures):"]
    lines += [f"  {{{', '.join(group)}}}" for group in found.groups if len(group) > 1]
    lines += ["", "No effect on any residual (detectable by vibration features or not at all):"]
    lines += [f"  {fault}" for fault in found.undetectable]
    lines += ["", "Fault present: faults that signs alone cannot rule out:"]
    lines += [
        f"  {fault}: {', '.join(g for g in others if g != fault) or 'isolated'}"
        for fault, others in found.ambiguity.items()
        if fault not in found.undetectable
    ]
    helpful = _helpful(arguments, faults, found, period)
    if helpful:
        lines += [
            "",
            "Additional sensors that would separate faults other than sensor faults:",
            *(f"  {words}" for words in helpful),
        ]
    by_features = never_split(_stand(arguments).features, faults)
    lines += in_words(by_features)
    content = {
        "sensors": list(model.sensors),
        "residuals": list(found.residuals),
        "never_split_by_features": by_features,
        "groups": [list(group) for group in found.groups if len(group) > 1],
        "undetectable": list(found.undetectable),
        "ambiguity": {fault: list(others) for fault, others in found.ambiguity.items()},
        "helpful": helpful,
    }
    return content, lines


def _helpful(
    arguments: argparse.Namespace, faults: dict[str, Fault], found: Diagnosability, period: float
) -> list[str]:
    from flea_diag.core.signatures.diagnosability import extra_sensors

    whole = _whole(arguments)
    fitted = _fitted(arguments, whole)
    lines = []
    plant = [f for f in faults if not faults[f].channel and f not in found.undetectable]
    for one, other in itertools.combinations(plant, 2):
        if other not in found.ambiguity[one]:
            continue
        extra = extra_sensors(whole, fitted, faults, one, other, period)
        words = [each.channel for each in extra]
        if faults[one].vibration or faults[other].vibration:
            words.append("accelerometers (fault-feature table)")
        lines.append(f"{one} from {other}: {', '.join(words) or 'none of the description'}")
    return lines


VIEWS: dict[str, Callable[[Actuator, argparse.Namespace], View]] = {
    "show": _show,
    "equations": equations,
    "tcg": _tcg,
    "signatures": _signatures,
    "diagnosability": _diagnosability,
}


OF_A_STAND = ("equations", "signatures", "diagnosability")
"""Those that no stand is shown in which another command would refuse; the others inspect."""


def model_of(arguments: argparse.Namespace) -> Actuator:
    """The described actuator with the fitted sensors."""
    whole = _whole(arguments)
    return whole.with_sensors(_fitted(arguments, whole)) if arguments.sensors else whole


def _whole(arguments: argparse.Namespace) -> Actuator:
    from flea_diag.configuration.files import load_yaml
    from flea_diag.core.bond_graph.actuator import actuator

    path = _stand(arguments).actuator
    return actuator(load_yaml(path), str(path), sound=arguments.view != "show")


def _stand(arguments: argparse.Namespace) -> Stand:
    return chosen_stand(arguments, "actuator", "faults")


def _fitted(arguments: argparse.Namespace, whole: Actuator) -> list[str]:
    return arguments.sensors.split(",") if arguments.sensors else list(whole.sensors)


def _faults(model: Actuator, arguments: argparse.Namespace) -> dict[str, Fault]:
    from flea_diag.configuration.files import load_yaml
    from flea_diag.core.faults.fault import catalogue, of_sensors

    path = _stand(arguments).faults
    known = of_sensors(catalogue(load_yaml(path), _whole(arguments), str(path)), model.sensors)
    for name in arguments.fault or ():
        if name not in known:
            raise ConfigurationError(f"--fault {name} is unknown: choose of {', '.join(known)}")
    return {name: known[name] for name in arguments.fault or known}


def _residuals(model: Actuator) -> tuple[str, ...]:
    from flea_diag.core.signatures.diagnosability import usable_residuals

    return usable_residuals(model)


def _quadrants(arguments: argparse.Namespace) -> tuple[Quadrant, ...]:
    from flea_diag.core.causal_graph.operating_point import QUADRANTS

    if arguments.quadrant is None:
        return QUADRANTS if arguments.view == "diagnosability" else QUADRANTS[:1]
    named = {f"i{_SIGN[q.current]},w{_SIGN[q.speed]}": q for q in QUADRANTS}
    if arguments.quadrant not in named:
        raise ConfigurationError(
            f"--quadrant {arguments.quadrant} is unknown: choose one of {' '.join(named)}"
        )
    return (named[arguments.quadrant],)


_SIGN = {1: "+", -1: "-"}


def _period(arguments: argparse.Namespace) -> float | None:
    if arguments.rate is None:
        return None
    # The negated comparison also refuses NaN.
    if not 0.1 <= arguments.rate <= 1e5:
        raise ConfigurationError(f"--rate {arguments.rate:g} Hz must lie between 0.1 and 100000 Hz")
    return 1.0 / float(arguments.rate)


def _indent(lines: Any) -> list[str]:
    return [f"  {line}" for line in lines]


def _columns(rows: list[list[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in rows]
