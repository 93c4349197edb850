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

"""Sections of a scenario with the defaults and limits of a machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, make_dataclass
from functools import lru_cache
from typing import Any, get_type_hints

from flea_diag.wire.parameters import build, parameter
from flea_sim_driver.machine.machine import Limits, Machine
from flea_sim_driver.plant.structure import StructureSpread
from flea_sim_driver.scenario.settings import Brake, HardStops, Load, Motion, Sensors, Switch

SECTIONS: dict[str, type] = {
    "motion": Motion, "load": Load, "travel": HardStops, "sensors": Sensors, "switch": Switch,
    "brake": Brake,
    "structure": StructureSpread,
}  # fmt: skip
SPREAD = "spread"
"""The section whose keys are the parameters in which units of the machine differ."""
STOPS_SHARE = 0.1
"""Share of the stroke within which a hard stop may lie beside its end."""
DIGITS = 12
"""Decimal places of a limit that is derived, so that a message shows it as one would write it."""


@lru_cache(maxsize=64)
def section_class(name: str, machine: Machine) -> type:
    """A section with the machine's defaults and limits, as a dataclass of its own."""
    if name == SPREAD:
        return make_dataclass(
            "Spread", [(key, float, _spread(key, value)) for key, value in machine.spread.items()],
            frozen=True,
        )  # fmt: skip
    kind, own = SECTIONS[name], _own(name, machine)
    hints = get_type_hints(kind)
    rows = [
        (entry.name, hints[entry.name], parameter(**{**_told(entry), **own[entry.name]}))
        for entry in fields(kind)
        if entry.name in own
    ]
    return make_dataclass(kind.__name__, rows, bases=(kind,), frozen=True)


def section(name: str, machine: Machine, values: object, where: str) -> Any:
    """A checked section of a scenario.

    Raises
    ------
    ConfigurationError
        Unknown key, wrong type, or a value outside the limits of the machine.
    """
    made = build(section_class(name, machine), values, where)
    if name == SPREAD:
        return made
    kind = SECTIONS[name]
    return kind(**{entry.name: getattr(made, entry.name) for entry in fields(kind)})


def _spread(name: str, value: float) -> Any:
    return parameter(value, f"of {name} between units, relative", minimum=0.0, maximum=1.0)


def _told(entry: Any) -> dict[str, Any]:
    """What a field says of itself, as ``parameter`` takes it."""
    return {"default": entry.default, **entry.metadata}


def _own(name: str, machine: Machine) -> Mapping[str, Mapping[str, Any]]:
    """Field of a section -> its default and limits on this machine."""
    limits, bench = machine.limits, machine.bench
    if name == "motion":
        return _motion(limits)
    if name == "load":
        return {
            "constant_n": {"minimum": -limits.load_n, "maximum": limits.load_n},
            "amplitude_n": {"maximum": limits.load_n},
            "payload_kg": {"default": bench.payload_kg, "maximum": limits.payload_kg},
        }
    if name == "travel":
        low, high = bench.travel_low_m, bench.travel_high_m
        beside = STOPS_SHARE * limits.stroke_m
        return {
            "stopped": {"default": bench.stopped},
            "low_m": {"default": low, "minimum": low, "maximum": round(low + beside, DIGITS)},
            "high_m": {"default": high, "minimum": round(high - beside, DIGITS), "maximum": high},
            "overtravel_m": {"maximum": round(0.5 * limits.stroke_m, DIGITS)},
        }
    if name == "structure":
        return {
            entry.name: {"default": getattr(machine.structure_spread, entry.name)}
            for entry in fields(StructureSpread)
        }
    return {}


def _motion(limits: Limits) -> Mapping[str, Mapping[str, Any]]:
    half = round(0.5 * limits.stroke_m, DIGITS)
    return {
        "amplitude_m": {"default": limits.amplitude_m, "maximum": half},
        "centre_m": {"default": limits.centre_m, "maximum": limits.stroke_m},
    }
