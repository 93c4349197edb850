"""``flea model``: an actuator's bond graph, equations, causal graph, signatures, diagnosability."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError
from flea_diag.tools.model import views as model_views

if TYPE_CHECKING:
    from flea_diag.core.bond_graph.actuator_model import Actuator

NAME = "model"
SUMMARY = "show an actuator's bond graph, equations, causal graph, signatures and diagnosability"
EXAMPLES = """\
examples:
  flea model show --svg graph.svg                     causality step by step, and a picture
  flea model equations --model driven                 what the observer integrates
  flea model tcg --from motor_speed-                  which faults would explain a low speed
  flea model signatures --rate 100                    what a diagnoser at 100 Hz sees
  flea model signatures --quadrant i-,w+ --json       textbook signatures while braking
  flea model diagnosability --sensors motor_current,motor_voltage,actuator_position
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("view", choices=model_views.VIEWS, help="what to show")
    add("--actuator", default="actuator.yaml", metavar="FILE", help="description (%(default)s)")
    add("--faults", default="faults.yaml", metavar="FILE", help="fault catalogue (%(default)s)")
    add("--model", default=None, metavar="NAME", help="equations, tcg: stand (default) or another")
    add("--sensors", default=None, metavar="A,B,...", help="only these sensors are fitted")
    add(
        "--fault",
        action="append",
        metavar="ID",
        help="signatures, diagnosability: only this (repeatable)",
    )
    add(
        "--quadrant",
        default=None,
        metavar="i+,w+",
        help="only this one (tcg --from, signatures, diagnosability)",
    )
    add(
        "--rate",
        type=float,
        metavar="HZ",
        help="scans per second (signatures: else textbook; diagnosability)",
    )
    add("--from", metavar="CHANNEL+/-", help="tcg: hypotheses for a deviation")
    add("--complete", action="store_true", help="with --from: also hypotheses by slower paths")
    add("--json", action="store_true", help="one JSON object on standard output")
    add("--dot", action="store_true", help="the picture as DOT text (show, tcg)")
    add("--svg", type=Path, metavar="OUT", help="the picture as SVG, by Graphviz (show, tcg)")


def run(arguments: argparse.Namespace) -> int:
    """Print one view."""
    from flea_diag.core.bond_graph.causality import require_sound

    model = model_views.model_of(arguments)
    if arguments.dot or arguments.svg:
        _picture(model, arguments)
    if not (arguments.dot or arguments.svg) or (arguments.svg and not arguments.json):
        content, lines = model_views.VIEWS[arguments.view](model, arguments)
        print(json.dumps(content, indent=1) if arguments.json else "\n".join(lines))
    # Shown all the same, so that one sees where; but nothing can be made of it.
    require_sound(model.graph, model.causality)
    return 0


def _picture(model: Actuator, arguments: argparse.Namespace) -> None:
    from flea_diag.core.drawing.picture import bond_graph_dot, causal_graph_dot
    from flea_diag.tools.graphviz import draw

    if arguments.view == "tcg":
        channels = frozenset(model.sensors)
        dot = causal_graph_dot(
            model_views.causal_graph(model, arguments), channels, model.graph.tokens()
        )
    elif arguments.view == "show":
        dot = bond_graph_dot(model.graph, model.causality)
    else:
        raise ConfigurationError(f"--svg and --dot draw show and tcg, not {arguments.view}")
    if arguments.svg:
        draw(dot, arguments.svg)
    else:
        print(dot)
