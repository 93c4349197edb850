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

"""Random machines: a description and a catalogue.

A machine is drawn part by part: drive, winding, motor, gear, friction, load, heat, sensors. Nothing
in it is tuned, and much of it is of no use; every command must take it, or refuse it in one line.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from support.machines.draft import Draft
from support.machines.parts import circuit, heat, mechanics

PERIOD_S = 0.02
SEEN = ("winding_resistance", "back_emf_constant", "dry_friction", "viscous_friction")
"""Parameters that most sensors see."""


def random_description(rng: np.random.Generator) -> dict[str, Any]:
    """One description, under ``faults`` its catalogue, and what no recording has (``unread``)."""
    draft = Draft(rng)
    driven = circuit(draft)
    heat(draft)
    moved = mechanics(draft)
    _sensors(draft, moved)
    _residuals(draft, moved)
    hold = {"motor_current": 1.5}
    by = [driven]
    if "motor_current" not in draft.sensors:
        hold = {next(iter(draft.sensors)): 5.0}
    elif "motor_speed" in draft.sensors:
        hold["motor_speed"] = 40.0
        by.append("commanded_load" if "commanded_load" in draft.inputs else "omega")
    base = dict(draft.base)
    if draft.may(0.1):
        base.pop(draft.one_of(*base), None)
    stated = [n for n in base if draft.may(0.4)]
    tolerances: dict[str, Any] = {name: f"{draft.one_of(2, 5, 20)} %" for name in stated}
    if draft.predicted or any(row["kind"] == "prediction" for row in draft.residuals.values()):
        tolerances["thermal_rate_k_per_s"] = 0.03
    made = {
        "schema_version": 1,
        "name": "drawn",
        "scan_period_s": PERIOD_S,
        "parameters": draft.parameters,
        "junctions": draft.junctions,
        "elements": draft.elements,
        "bonds": draft.bonds,
        "sensors": draft.sensors,
        "inputs": draft.inputs,
        "models": _models(draft),
        "operating_point": {"hold": hold, "by": by, "fixed": draft.fixed},
        "residuals": draft.residuals,
        "predicted": draft.predicted,
        "tolerances": tolerances,
        "base_parameters": base,
        "travel": (
            {"at": moved, "low_m": -50.0, "high_m": 50.0}
            if "actuator_position" in draft.sensors and draft.may(0.3)
            else {}
        ),
        "faults": _faults(draft),
        "unread": [name for name in (*draft.sensors, *draft.inputs) if draft.may(0.07)],
    }
    # Drawn last: what was drawn before is the same with and without.
    made["modes"] = _modes(draft, moved)
    return _supplied(draft, made)


def _supplied(draft: Draft, made: dict[str, Any]) -> dict[str, Any]:
    """The same, or with a supply that a channel reads, with and without what it needs."""
    if draft.may(0.7):
        return {**made, "supplies": {}}
    made["parameters"]["bus_level"] = {"value": 48.0, "unit": "V"}
    made["junctions"]["link"] = {"type": "0", "domain": "electrical"}
    level = {"level": "bus_level"}
    made["elements"]["mains"] = {"type": "Se", "law": "constant_effort", "parameters": level}
    made["bonds"] = [*made["bonds"], "mains -> link"]
    made["sensors"]["bus_voltage"] = {"at": "link", "unit": "V", "noise": 0.1}
    if draft.may(0.8):
        made["residuals"]["parity_supply"] = {
            "kind": "difference", "channel": "bus_voltage", "offset": "bus_level", "unit": "V",
        }  # fmt: skip
    if draft.may(0.8):
        made["base_parameters"]["bus_level_v"] = "bus_level"
    if draft.may(0.5) and "parity_drive" in made["residuals"]:
        made["residuals"]["parity_drive"]["supplied_by"] = draft.one_of("mains", "mains", "other")
    good = {"low": 40.0, "high": 56.0}
    band = draft.one_of(good, good, good, {"low": 40.0}, {"low": 50.0, "high": 56.0}, {})
    channel = draft.one_of("bus_voltage", "bus_voltage", "bus_voltage", "nothing")
    return {**made, "supplies": {"mains": {"channel": channel, **band}}}


def _modes(draft: Draft, moved: str) -> dict[str, Any]:
    """Nothing, or a mode that a channel tells, with some of what it may do."""
    if draft.may(0.6):
        return {}
    names = list(draft.residuals)
    limit = draft.one_of({"above": 0.5}, {"below": 0.5}, {"above": 0.5, "below": 1.5}, {})
    mode = {"channel": "mode_told", **limit, "settles_s": draft.one_of(0.0, 0.2)}
    if draft.may(0.7):
        mode["holds"] = draft.one_of(moved, moved, "shaft", "terminals")
    if names and draft.may(0.3):
        mode[draft.one_of("voids", "voids", "only")] = [draft.one_of(*names)]
    return {"told": mode}


def _sensors(draft: Draft, moved: str) -> None:
    """Some of those that such machines have, each at its place."""
    turns = draft.junctions[moved]["domain"] == "rotation"
    known: dict[str, dict[str, Any]] = {
        "motor_voltage": {"at": "terminals", "unit": "V", "noise": 0.05},
        "motor_current": {"at": "armature", "unit": "A", "noise": 0.02},
        "motor_speed": {"at": "shaft", "unit": "rad/s", "noise": 0.1},
        "actuator_position": {
            "at": moved, "unit": "rad" if turns else "m", "noise": 1e-4 if turns else 1e-5,
            "integrates": True, "state": "turned",
        },
    }  # fmt: skip
    if "cell" in draft.junctions:
        unit = "N*m" if turns else "N"
        known["load_force"] = {"at": "cell", "unit": unit, "noise": 0.01 if turns else 1.0}
    for number, name in enumerate(
        ("motor_temperature", "housing_temperature", "outer_temperature")
    ):
        if f"node_{number}" in draft.junctions:
            known[name] = {"at": f"node_{number}", "unit": "degC", "noise": 0.1}
    for channel, offset, name in (
        ("motor_voltage", "voltage_offset", "voltage_offset_v"),
        ("motor_current", "current_offset", "current_offset_a"),
    ):
        if draft.may(0.6):
            draft.constant(offset, 0.0, known[channel]["unit"])
            known[channel]["offset"] = offset
            draft.base[name] = offset
    kept = [
        n for n in known if draft.may(0.97 if n in ("motor_current", "actuator_position") else 0.7)
    ]
    draft.sensors = {name: known[name] for name in kept or ["motor_current"]}
    if "actuator_position" in draft.sensors:
        draft.fixed["turned"] = 0.1


def _residuals(draft: Draft, moved: str) -> None:
    divided = {"divided_by": "ratio"} if "ratio" in draft.parameters else {}
    without = {"without": ["inductance"]} if "inductance" in draft.elements else {}
    unit = "N" if draft.junctions[moved]["domain"] == "translation" else "N*m"
    balance = {"kind": "junction", "junction": "shaft", "unit": unit, **divided}
    circuit = {"kind": "junction", "junction": "armature", "unit": "V", **without}
    found: dict[str, dict[str, Any]] = {
        "parity_mechanical": balance,
        "parity_mechanical_dn": {**balance, "normalised": True},
        "parity_electrical": circuit,
        "parity_electrical_dn": {**circuit, "normalised": True, "motion": "shaft"},
    }
    if {"motor_speed", "actuator_position"} <= set(draft.sensors):
        found["parity_speed"] = {
            "kind": "difference", "channel": "motor_speed", "reference": "actuator_position",
            "unit": "m/s" if unit == "N" else "rad/s", "signs": False,
        }  # fmt: skip
    if "commanded_voltage" in draft.inputs and "motor_voltage" in draft.sensors:
        found["parity_drive"] = {
            "kind": "difference", "channel": "motor_voltage", "reference": "commanded_voltage",
            "gain": "drive_gain", "offset": "drive_offset", "unit": "V",
        }  # fmt: skip
    for name in ("motor_temperature", "housing_temperature", "outer_temperature"):
        if name in draft.sensors and draft.may(0.8):
            found[name] = {"kind": "prediction", "channel": name, "model": "stand", "unit": "degC"}
            if "copper" in draft.parameters:
                found[name]["neglected"] = ["copper"]
    if "motor_temperature" in found and "winding_temperature" in draft.parameters:
        draft.predicted["winding_temperature"] = "motor_temperature"
    kept = {name: row for name, row in found.items() if draft.may(0.95)}
    if "motor_temperature" not in kept:
        draft.predicted.clear()
    draft.residuals = kept


def _models(draft: Draft) -> dict[str, Any]:
    measured = [name for name in ("motor_voltage", "load_force") if name in draft.sensors]
    if not measured or draft.may():
        return {"stand": {}}
    return {"stand": {}, "driven": {"measured": measured}}


def _faults(draft: Draft) -> dict[str, Any]:
    """Rises and losses of parameters, some with a size, and errors of all sensors."""
    rows: dict[str, Any] = {}
    for name in draft.parameters:
        if name in draft.predicted or draft.may(0.6):
            continue
        sign = draft.one_of("+", "-")
        rows[f"{name}_{'rise' if sign == '+' else 'loss'}"] = {
            "component": name, "hypotheses": [[f"{name}{sign}"]], "approach": "physics",
            "onset": draft.one_of("any", "abrupt", "incipient"), "size": 0.3,
        }  # fmt: skip
        if draft.may(0.6 if name in SEEN else 0.02):
            way = 1 if sign == "+" else -1
            rows[f"{name}_{'rise' if sign == '+' else 'loss'}"]["effects"] = [
                {"sizes": [{"name": "share", "unit": "1", "scales": {name: way}, "high": 0.9}]}
            ]
    modes = ("bias", "drift", "scaling", "dead", "noise", "dropout")
    return {
        "schema_version": 1,
        "faults": rows,
        "sensor_modes": {
            mode: {"approach": "physics", "onset": "incipient" if mode == "drift" else "abrupt"}
            for mode in modes
        },
    }
