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

"""What each law says, for people: its equation and a place where it is met.

The parameters, their units and bounds are those of ``law.LAWS``; the reference is made of both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from flea_diag.core.bond_graph.bond_graph import DOMAINS
from flea_diag.core.bond_graph.law import LAWS, Ports
from flea_diag.core.symbolic.unit import UNITS, dimension, spelled


@dataclass(frozen=True)
class LawRow:
    """One law: ``e`` and ``f`` are effort and flow, ``q`` the displacement, ``by`` what modulates.

    Units are given for the domains of ``ports``.
    """

    equation: str
    example: str
    ports: tuple[str, ...] = ("rotation",)


ROWS: dict[str, LawRow] = {
    "resistance": LawRow("e = resistance f", "a damper, a winding, a path of heat"),
    "friction": LawRow(
        "e = coulomb tanh(f / smooth_flow) + viscous f", "gear, guide or screw; most machines"
    ),
    "dry": LawRow(
        "e = level tanh(f / smooth_flow)",
        "what the dead time of a bridge takes, on the side of the current; brushes",
        ("electrical",),
    ),
    "stribeck": LawRow(
        "e = (coulomb + (breakaway - coulomb) exp(-(f / stribeck_flow)^2)) tanh(f / smooth_flow)"
        " + viscous f",
        "a seal or a greased guide that sticks at low speed",
    ),
    "loaded_friction": LawRow(
        "e = (coulomb + load_share |by|) tanh(f / smooth_flow) + viscous f",
        "a screw whose friction grows with its load: modulated_by the junction of the load",
    ),
    "warm_friction": LawRow(
        "e = (coulomb tanh(f / smooth_flow) + viscous f) (1 + per_kelvin (by - reference))",
        "grease that thins as it warms up: modulated_by the thermal junction of a thermometer",
    ),
    "warm_resistance": LawRow(
        "e = resistance (1 + per_kelvin (temperature - reference)) f",
        "a copper winding, its temperature predicted",
        ("electrical",),
    ),
    "inertia": LawRow("e = inertia df/dt", "rotor, carriage, payload; an inductance"),
    "stiffness": LawRow("e = stiffness q", "a coupling, a belt, a spring"),
    "stretch_and_play": LawRow(
        "q = compliance e + play/2 tanh(e / smooth_effort)", "the coupling between two positions"
    ),
    "link_weight": LawRow(
        "e = level cos(q) + upright sin(q)",
        "an arm under gravity; level is its moment where it lies at q = 0, upright where it lies a"
        " quarter turn on",
    ),
    "capacity": LawRow("f = capacity de/dt", "what heat warms", ("thermal",)),
    "transformer": LawRow(
        "e1 = ratio e2, f2 = ratio f1", "a gear, a screw, a pulley", ("rotation", "translation")
    ),
    "crank": LawRow(
        "e1 = n e2, f2 = n f1, n = radius cos(q1 - zero)",
        "a crank with a long rod; q1 is the angle at port 1, which a position sensor reads",
        ("rotation", "translation"),
    ),
    "converter": LawRow(
        "e1 f1 = e2 f2", "a drive whose duty a controller sets", ("electrical", "rotation")
    ),
    "gyrator": LawRow(
        "e1 = modulus f2, e2 = modulus f1", "a motor by one constant", ("electrical", "rotation")
    ),
    "motor": LawRow(
        "e1 = back_emf f2, e2 = torque f1", "a motor by two constants", ("electrical", "rotation")
    ),
    "gain": LawRow("e = gain signal, or f", "a source that answers to a command"),
    "constant_effort": LawRow(
        "e = level",
        "the weight of a carriage: type Se; a supply of known voltage",
        ("translation",),
    ),
    "dissipation": LawRow(
        "f = share sum of e f over powers", "the heat of windings and friction", ("thermal",)
    ),
}


def law_lines() -> Iterator[str]:
    """Rows of a table in Markdown: law, element, equation, parameters, where it is met."""
    yield "| law | type | equation | parameters | example |"
    yield "|---|---|---|---|---|"
    for name, law in LAWS.items():
        row = ROWS[name]
        thermal = "per_kelvin" in law.roles
        by = dimension(DOMAINS["thermal" if thermal else "rotation"][0])
        units = [dimension(unit) for domain in row.ports for unit in DOMAINS[domain]]
        effort, flow, effort_2, flow_2 = (*units, UNITS["1"], UNITS["1"])[:4]
        ports = Ports(effort, flow, effort_2, flow_2, by)
        roles = "; ".join(
            f"`{role}` in {spelled(known.dimension(ports)) or '1'}"
            + ("" if known.bound == "any" else f", {known.bound}")
            + (" (assumed)" if known.assumed else "")
            for role, known in law.roles.items()
        )
        kind = "Se, Sf, MSe or MSf" if law.kind == "M" else law.kind
        equation = row.equation.replace("|", "\\|")
        yield f"| `{name}` | {kind} | {equation} | {roles} | {row.example} |"
