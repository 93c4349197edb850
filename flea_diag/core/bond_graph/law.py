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

"""Constituent laws of bond graph elements: roles, units, bounds and formulas, one row each.

A new law is a row here. ``roles`` name the parameters of the law with the dimension they
must have, as a function of the dimensions of effort and flow at the element's ports.
Friction uses tanh(flow/smooth_flow) for the sign of the flow: Coulomb and Stribeck laws
stay differentiable, and tend to the textbook law as ``smooth_flow`` goes to zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from flea_diag.core.symbolic.expression import Expression, apply
from flea_diag.core.symbolic.unit import SECOND, UNITS, Dimension, per, times

Values = Mapping[str, Expression]
Formula = Callable[[Expression, Values], Expression]


@dataclass(frozen=True)
class Ports:
    """Dimensions of effort and flow at port 1, at port 2 of a TF or GY; of what modulates it."""

    effort: Dimension
    flow: Dimension
    effort_2: Dimension = UNITS["1"]
    flow_2: Dimension = UNITS["1"]
    by: Dimension = UNITS["1"]
    """Of the common variable of the junction that modulates the element."""


@dataclass(frozen=True)
class Role:
    """One parameter of a law: its dimension and the range it must lie in."""

    dimension: Callable[[Ports], Dimension]
    bound: str = "> 0"
    """``> 0``, ``>= 0``, ``!= 0`` or ``any``."""
    assumed: bool = False
    """Whether its value is the description's: a width, or a constant of a material."""

    def admits(self, value: float) -> bool:
        """Whether a value lies in the range; NaN never does."""
        return {
            "> 0": value > 0,
            ">= 0": value >= 0,
            "!= 0": abs(value) > 0,
            "any": not math.isnan(value),
        }[self.bound]


@dataclass(frozen=True)
class Law:
    """How the parameters of an element relate its effort and flow.

    ``effort`` gives the effort of an R for a flow, or of a C for a displacement, ``flow`` the
    reverse (None if the law cannot be inverted, so that the element needs the flow as input). A
    ``modulated`` law also depends on
    the common variable of another junction, which its formulas take as ``p["by"]``.
    """

    kind: str
    roles: Mapping[str, Role]
    effort: Formula | None = None
    flow: Formula | None = None
    modulated: bool = False
    ratio: Formula | None = None
    """Of a TF whose ratio follows the displacement at its port 1, which it takes first."""


def _smooth_sign(flow: Expression, p: Values) -> Expression:
    return apply("tanh", flow / p["smooth_flow"])


def _stribeck(flow: Expression, p: Values) -> Expression:
    decay = apply("exp", -((flow / p["stribeck_flow"]) ** 2))
    level = p["coulomb"] + (p["breakaway"] - p["coulomb"]) * decay
    return level * _smooth_sign(flow, p) + p["viscous"] * flow


def _contact(effort: Expression, p: Values) -> Expression:
    """Half the play, on the side that an effort presses against."""
    return p["play"] / 2 * apply("tanh", effort / p["smooth_effort"])


def _warm_resistance(p: Values) -> Expression:
    return p["resistance"] * (1 + p["per_kelvin"] * (p["temperature"] - p["reference"]))


_RESISTANCE = Role(lambda d: per(d.effort, d.flow))
_VISCOUS = Role(lambda d: per(d.effort, d.flow), ">= 0")
_LEVEL = Role(lambda d: d.effort, ">= 0")
_WIDTH = Role(lambda d: d.flow, assumed=True)

LAWS: dict[str, Law] = {
    "resistance": Law(
        "R",
        {"resistance": _RESISTANCE},
        effort=lambda f, p: p["resistance"] * f,
        flow=lambda e, p: e / p["resistance"],
    ),
    "friction": Law(
        "R",
        {"coulomb": _LEVEL, "viscous": _VISCOUS, "smooth_flow": _WIDTH},
        effort=lambda f, p: p["coulomb"] * _smooth_sign(f, p) + p["viscous"] * f,
    ),
    "dry": Law(
        "R",
        {"level": _LEVEL, "smooth_flow": _WIDTH},
        effort=lambda f, p: p["level"] * _smooth_sign(f, p),
    ),
    "loaded_friction": Law(
        "R",
        {
            "coulomb": _LEVEL,
            "load_share": Role(lambda d: per(d.effort, d.by), ">= 0"),
            "viscous": _VISCOUS,
            "smooth_flow": _WIDTH,
        },
        effort=lambda f, p: (
            (p["coulomb"] + p["load_share"] * apply("fabs", p["by"])) * _smooth_sign(f, p)
            + p["viscous"] * f
        ),
        modulated=True,
    ),
    "warm_friction": Law(
        "R",
        {
            "coulomb": _LEVEL,
            "viscous": _VISCOUS,
            "per_kelvin": Role(lambda d: per(UNITS["1"], d.by), "any"),
            "reference": Role(lambda d: d.by, "any", assumed=True),
            "smooth_flow": _WIDTH,
        },
        effort=lambda f, p: (
            (p["coulomb"] * _smooth_sign(f, p) + p["viscous"] * f)
            * (1 + p["per_kelvin"] * (p["by"] - p["reference"]))
        ),
        modulated=True,
    ),
    "warm_resistance": Law(
        "R",
        {
            "resistance": _RESISTANCE,
            "per_kelvin": Role(lambda d: per(UNITS["1"], UNITS["K"]), ">= 0", assumed=True),
            "temperature": Role(lambda d: UNITS["K"], "any"),
            "reference": Role(lambda d: UNITS["K"], "any", assumed=True),
        },
        effort=lambda f, p: _warm_resistance(p) * f,
        flow=lambda e, p: e / _warm_resistance(p),
    ),
    "stribeck": Law(
        "R",
        {
            "coulomb": _LEVEL,
            "breakaway": _LEVEL,
            "stribeck_flow": _WIDTH,
            "viscous": _VISCOUS,
            "smooth_flow": _WIDTH,
        },
        effort=_stribeck,
    ),
    "inertia": Law("I", {"inertia": Role(lambda d: per(times(d.effort, SECOND), d.flow))}),
    "stiffness": Law(
        "C",
        {"stiffness": Role(lambda d: per(d.effort, times(d.flow, SECOND)))},
        effort=lambda q, p: p["stiffness"] * q,
        flow=lambda e, p: e / p["stiffness"],
    ),
    # The effort is exact in the play to first order: that of a healthy part.
    "stretch_and_play": Law(
        "C",
        {
            "compliance": Role(lambda d: per(times(d.flow, SECOND), d.effort)),
            "play": Role(lambda d: times(d.flow, SECOND), ">= 0"),
            "smooth_effort": Role(lambda d: d.effort, assumed=True),
        },
        effort=lambda q, p: (q - _contact(q / p["compliance"], p)) / p["compliance"],
        flow=lambda e, p: p["compliance"] * e + _contact(e, p),
    ),
    # An arm in the field of gravity is a store: lifting it takes power, lowering it gives it back.
    "link_weight": Law(
        "C",
        {"level": Role(lambda d: d.effort, "any"), "upright": Role(lambda d: d.effort, "any")},
        effort=lambda q, p: p["level"] * apply("cos", q) + p["upright"] * apply("sin", q),
    ),
    "capacity": Law("C", {"capacity": Role(lambda d: per(times(d.flow, SECOND), d.effort))}),
    "transformer": Law("TF", {"ratio": Role(lambda d: per(d.effort, d.effort_2), "!= 0")}),
    "crank": Law(
        "TF",
        {
            "radius": Role(lambda d: per(d.effort, d.effort_2), "!= 0"),
            "zero": Role(lambda d: times(d.flow, SECOND), "any", assumed=True),
        },
        ratio=lambda q, p: p["radius"] * apply("cos", q - p["zero"]),
    ),
    "converter": Law("TF", {"ratio": Role(lambda d: per(d.effort, d.effort_2), "!= 0")}),
    "gyrator": Law("GY", {"modulus": Role(lambda d: per(d.effort, d.flow_2), "!= 0")}),
    "motor": Law(
        "GY",
        {
            "back_emf": Role(lambda d: per(d.effort, d.flow_2), "!= 0"),
            "torque": Role(lambda d: per(d.effort_2, d.flow), "!= 0"),
        },
    ),
    "gain": Law("M", {"gain": Role(lambda d: UNITS["1"], "!= 0")}),
    "constant_effort": Law("M", {"level": Role(lambda d: d.effort, "!= 0")}),
    "dissipation": Law("M", {"share": Role(lambda d: UNITS["1"], "> 0")}),
}
"""Law by name. A TF obeys e1 = n e2, f2 = n f1; a GY e1 = r f2, e2 = r f1 (a motor may have
different constants for back-EMF and torque); a converter is a TF whose ratio a controller sets, so
that only its power is known; an I has e = I f', a C has f = C e' = (e/K)'."""

DEFAULT_LAW = {
    "R": "resistance",
    "I": "inertia",
    "C": "capacity",
    "TF": "transformer",
    "GY": "gyrator",
}
