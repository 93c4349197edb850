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

"""Operating points at which signatures are evaluated: quadrants and their steady values.

The sign of a parameter's effect depends on the signs of current and speed (the quadrant). In
each quadrant the inputs that hold the given magnitudes in steady state are solved for. Where no
load can be commanded a motor brakes only while its speed changes: then a state holds a magnitude,
and is not steady.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flea_diag.core.bond_graph.actuator_model import Actuator
from flea_diag.core.bond_graph.causal_relation import in_order
from flea_diag.core.bond_graph.state_space import StateSpace
from flea_diag.core.symbolic.expression import evaluate, symbols
from flea_diag.errors import ModelError

NEGLIGIBLE = 1e-9
"""Values below this are solver residue and count as zero."""


@dataclass(frozen=True)
class Quadrant:
    """Signs of the held current and speed."""

    current: int
    speed: int

    def __str__(self) -> str:
        sign = {1: ">0", -1: "<0", 0: "=0"}
        return f"i{sign[self.current]}, omega{sign[self.speed]}"


QUADRANTS = (Quadrant(1, 1), Quadrant(-1, 1), Quadrant(-1, -1), Quadrant(1, -1))
"""Motoring out, braking out, motoring in, braking in."""


def operating_values(
    actuator: Actuator, quadrant: Quadrant, speed: float = 1.0
) -> dict[str, float]:
    """Values of all variables, inputs and parameters in a quadrant, SI units.

    Parameters
    ----------
    speed
        Factor on the speed given in the description.

    Raises
    ------
    ModelError
        No steady state has the values asked for.
    """
    channels = [element.signal for element in actuator.graph.of_kind("De", "Df")]
    model = actuator.state_space("stand", channels)
    point = actuator.operating
    signs = {True: quadrant.current, False: quadrant.speed * speed}
    targets = [value * signs[_is_electrical(actuator, name)] for name, value in point.hold.items()]
    x = np.array([point.fixed.get(name, 0.0) for name in model.states])
    u = np.array([point.fixed.get(name, 0.0) for name in model.inputs])
    free_x = [k for k, name in enumerate(model.states) if name not in point.fixed]
    steady_x = [k for k in free_x if model.states[k] not in point.by]
    free_u = [k for k, name in enumerate(model.inputs) if name in point.by]
    held = [model.outputs.index(name) for name in point.hold]
    asked = ", ".join(f"{name} = {value:g}" for name, value in point.hold.items())
    where = f"{actuator.name}: operating_point holds {asked} by {', '.join(point.by)}"
    for _ in range(50):
        free, equal = (free_x, free_u), (steady_x, held)
        step = _newton_step(model, x, u, free, equal, np.array(targets), where)
        x[free_x] += step[: len(free_x)]
        u[free_u] += step[len(free_x) :]
        if np.max(np.abs(step)) <= 1e-12 * (1.0 + np.max(np.abs(x))):
            return _all_values(actuator, model.values(x, u))
    raise ModelError(
        f"{actuator.name}: no steady state holds {dict(zip(point.hold, targets, strict=True))};"
        " choose other values in operating_point"
    )


def _is_electrical(actuator: Actuator, channel: str) -> bool:
    graph = actuator.graph
    detectors = [e.name for e in graph.of_kind("De", "Df") if e.signal == channel]
    places = [bond.other(name) for name in detectors for bond in graph.at(name)]
    return any(graph.elements[name].domain == "electrical" for name in places)


def _newton_step(
    model: StateSpace,
    x: np.ndarray,
    u: np.ndarray,
    free: tuple[list[int], list[int]],
    equal: tuple[list[int], list[int]],
    targets: np.ndarray,
    where: str,
) -> np.ndarray:
    """Step of the free states and inputs towards steady states and held outputs."""
    (free_x, free_u), (steady_x, held) = free, equal
    linear = model.linearise(x, u)
    error = np.concatenate(
        [-model.derivatives(x, u)[steady_x], targets - model.measure(x, u)[held]]
    )
    top = np.hstack([linear.a[np.ix_(steady_x, free_x)], linear.b[np.ix_(steady_x, free_u)]])
    low = np.hstack([linear.c[np.ix_(held, free_x)], linear.d[np.ix_(held, free_u)]])
    matrix = np.vstack([top, low])
    if matrix.shape[0] != matrix.shape[1]:
        raise ModelError(
            f"{where}: it needs one input for each value that it holds, and every state that is no"
            " input of it steady, or under 'fixed'"
        )
    scale = np.maximum(np.max(np.abs(matrix), axis=1), 1e-300)
    try:
        step: np.ndarray = np.linalg.solve(matrix / scale[:, None], error / scale)
    except np.linalg.LinAlgError as cause:
        raise ModelError(
            f"{where}: that cannot be held by those inputs, or a state has no steady value; name"
            " inputs that move it, and put integrating states under 'fixed'"
        ) from cause
    return step


def _all_values(actuator: Actuator, known: dict[str, float]) -> dict[str, float]:
    """All variables, of what the readings depend on; what no reading depends on is as stated."""
    relations = actuator.relations("stand")
    unseen = dict.fromkeys((name for r in relations for name in symbols(r.expression)), 0.0)
    values = {**unseen, **actuator.graph.values(), **actuator.operating.fixed, **known}
    for relation in in_order(relations):
        value = float(evaluate(relation.expression, values))
        values[relation.target] = value if abs(value) > NEGLIGIBLE else 0.0
    return values


def sign_of(number: float) -> int:
    """1, -1 or 0."""
    return (number > 0) - (number < 0)


def rates(actuator: Actuator, values: dict[str, float]) -> dict[str, float]:
    """Channel -> its rate of change at a steady point: that of a displacement is a flow."""
    return {
        channel: values.get(actuator.variable(channel), 0.0) if sensor.integrates else 0.0
        for channel, sensor in actuator.sensors.items()
    }
