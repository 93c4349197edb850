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

"""``flea model``: bond graph, equations, causal graph, signatures, diagnosability."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flea_diag.errors import ConfigurationError
from flea_diag.tools.argument import add_json
from flea_diag.tools.model import views as model_views
from flea_diag.tools.stand_option import accepted_stand, add_stand
from flea_diag.tools.terminal import say, tell

if TYPE_CHECKING:
    from flea_diag.core.bond_graph.actuator_model import Actuator

NAME = "model"
SUMMARY = "show bond graph, equations, causal graph, signatures or diagnosability of an actuator"
EXAMPLES = """\
examples:
  flea model show --svg graph.svg                     causality assignment, and a drawing
  flea model equations --model driven                 equations integrated by the observer
  flea model equations --calibration mine.yaml        relations that run, with calibrated numbers
  flea model signatures --stand ./mine                of a stand of your own
  flea model tcg --from motor_speed-                  faults that explain a low speed
  flea model signatures --rate 100                    signatures as sampled at 100 Hz
  flea model signatures --quadrant i-,w+ --json       initial signatures while braking
  flea model diagnosability --sensors motor_current,motor_voltage,actuator_position
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("view", choices=model_views.VIEWS, help="view to show")
    add_stand(parser)
    add("--actuator", metavar="FILE", help="actuator description (default: that of the stand)")
    add("--faults", metavar="FILE", help="fault catalogue (default: that of the stand)")
    add(
        "--model",
        default=None,
        metavar="NAME",
        help="model of the description (equations, tcg; default stand)",
    )
    add(
        "--calibration",
        default=None,
        metavar="FILE",
        help="calibration whose numbers and channels the relations take (equations)",
    )
    add("--sensors", default=None, metavar="A,B,...", help="sensors fitted (default all)")
    add(
        "--fault",
        action="append",
        metavar="ID",
        help="show this fault only, repeatable (signatures, diagnosability)",
    )
    add(
        "--quadrant",
        default=None,
        metavar="i+,w+",
        help="show this quadrant only (tcg --from, signatures, diagnosability)",
    )
    add(
        "--rate",
        type=float,
        metavar="HZ",
        help="sampling rate (diagnosability; signatures: default initial signatures)",
    )
    add("--from", metavar="CHANNEL+/-", help="hypotheses for this deviation (tcg)")
    add("--complete", action="store_true", help="with --from: include hypotheses by slower paths")
    add_json(parser, "the view")
    add("--dot", action="store_true", help="print the graph as DOT text (show, tcg)")
    add("--svg", type=Path, metavar="OUT", help="draw the graph as SVG by Graphviz (show, tcg)")


def run(arguments: argparse.Namespace) -> int:
    """Print one view."""
    from flea_diag.core.bond_graph.causality import require_sound

    model = model_views.model_of(arguments)
    if arguments.view in model_views.OF_A_STAND and model.base_parameters:
        accepted_stand(arguments, "actuator", "faults")
    if arguments.dot or arguments.svg:
        _picture(model, arguments)
    if not (arguments.dot or arguments.svg) or (arguments.svg and not arguments.json):
        content, lines = model_views.VIEWS[arguments.view](model, arguments)
        tell(arguments.json, content, "\n".join(lines))
    # Shown for inspection, but without causality there is nothing to compute.
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
        raise ConfigurationError(f"--svg and --dot apply to show and tcg, not to {arguments.view}")
    if arguments.svg:
        draw(dot, arguments.svg)
    else:
        say(dot)
