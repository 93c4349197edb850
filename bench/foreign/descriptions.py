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

"""The stand of a foreign machine, as an engineer writes it from data sheets: its folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import yaml
from machines import Foreign

FEATURES = """\
schema_version: 1
title: none
provenance: no accelerometer was recorded
alphabet: ["0", "1"]
confidence: 1.0
features:
  accelerometer_1_std: {cost: 1.0}
faults:
  spall: {accelerometer_1_std: "1", source: assumption}
"""
STAND = {
    "schema_version": 1, "actuator": "actuator.yaml", "faults": "faults.yaml",
    "calibration": "calibration.yaml", "features": "feature_table.yaml",
    "channels": "channels.yaml",
}  # fmt: skip
UNITS = {"motor_current": "A", "motor_speed": "rad/s", "motor_voltage": "V", "bus_voltage": "V",
         "commanded_voltage": "V", "motor_temperature": "degC"}  # fmt: skip


def write_stand(made: Foreign, folder: Path) -> None:
    """Every file of it but the calibration."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "stand.yaml": {**STAND, "name": made.name},
        "actuator.yaml": description(made),
        "faults.yaml": catalogue(made),
        "channels.yaml": channels(made),
    }
    for name, content in files.items():
        text = yaml.safe_dump(content, sort_keys=False)
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "feature_table.yaml").write_text(FEATURES, encoding="utf-8")


def unit_of(made: Foreign, channel: str) -> str:
    """SI unit of a channel."""
    return UNITS.get(channel, "rad" if made.arm else "m")


def channels(made: Foreign) -> dict[str, Any]:
    """Columns of the tables that ``score`` writes."""
    wide = {"A": 60.0, "V": 2.0 * made.numbers.supply, "rad/s": 8.0 * made.fast / made.ratio}
    rows: dict[str, Any] = {}
    for name in made.channels:
        unit = unit_of(made, name)
        most = wide.get(unit, 10.0 * made.reach)
        most = 3.0 * made.numbers.limit if unit == "A" else most
        row: dict[str, Any] = {"column": name, "unit": unit, "range": [-most, most]}
        if unit == "degC":
            row["range"] = [-40.0, 200.0]
        rows[name] = row
    return {
        "schema_version": 1, "rate_hz": 100.0, "channels": rows,
        "time": {"column": "time_s", "unit": "s", "start": "2026-01-01T00:00:00Z"},
    }  # fmt: skip


# long: one description, read top to bottom as such a file is
def description(made: Foreign) -> dict[str, Any]:
    """Bond graph, parameters, sensors and residuals."""
    turns = bool(made.arm)
    domain, place, force = ("rotation", "rad", "N*m") if turns else ("translation", "m", "N")
    per = "1" if turns else "m/rad"
    n, sheet = made.numbers, made.sheet
    ratio = made.ratio
    inertia = (n.mass + n.load_mass) * sheet["mass"]
    heat = (n.winding_capacity + n.housing_capacity) * sheet["capacity"]
    p: dict[str, tuple[float, str]] = {
        "current_offset": (0.0, "A"),
        "winding_resistance": (n.resistance * sheet["resistance"], "ohm"),
        "copper_per_kelvin": (3.93e-3, "1/K"),
        "winding_reference_temperature": (25.0, "degC"),
        "winding_temperature": (25.0, "degC"),
        "back_emf_constant": (n.constant * ratio * sheet["constant"], "V*s/rad"),
        "torque_constant": (n.constant * ratio * sheet["constant"], "N*m/A"),
        "gear_ratio": (ratio, per),
        "moved_inertia": (inertia, "kg*m^2" if turns else "kg"),
        "coulomb_friction": (n.dry * sheet["dry"], force),
        "viscous_friction": (n.viscous * sheet["viscous"], "N*m*s/rad" if turns else "N*s/m"),
        "smooth_speed": (0.04 * made.fast, f"{place}/s"),
        "winding_heat_share": (1.0, "1"),
        "motor_capacity": (heat, "J/K"),
    }
    junctions = {
        "terminals": ("0", "electrical"), "armature": ("1", "electrical"),
        "shaft": ("1", "rotation"), "moved": ("1", domain), "motor_node": ("0", "thermal"),
    }  # fmt: skip
    warm = {"resistance": "winding_resistance", "per_kelvin": "copper_per_kelvin",
            "reference": "winding_reference_temperature",
            "temperature": "winding_temperature"}  # fmt: skip
    rubs = {"coulomb": "coulomb_friction", "viscous": "viscous_friction",
            "smooth_flow": "smooth_speed"}  # fmt: skip
    constants = {"back_emf": "back_emf_constant", "torque": "torque_constant"}
    elements: dict[str, Any] = {
        "drive": {"type": "MSf", "signal": "commanded_current"},
        "winding": {"type": "R", "law": "warm_resistance", "parameters": warm},
        "motor": {"type": "GY", "law": "motor", "parameters": constants},
        "gear": {"type": "TF", "parameters": {"ratio": "gear_ratio"}},
        "inertia": {"type": "I", "state": "speed", "parameters": {"inertia": "moved_inertia"}},
        "friction": {"type": "R", "law": "friction", "parameters": rubs},
        "heat": {"type": "MSf", "law": "dissipation", "powers": ["winding"],
                 "parameters": {"share": "winding_heat_share"}},
        "motor_mass": {"type": "C", "law": "capacity", "state": "T_motor",
                       "parameters": {"capacity": "motor_capacity"}},
    }  # fmt: skip
    bonds = ["drive -> terminals", "terminals -> armature", "armature -> winding",
             "armature -> motor", "motor -> shaft", "shaft -> gear", "gear -> moved",
             "moved -> inertia", "moved -> friction", "moved -> weight", "heat -> motor_node",
             "motor_node -> motor_mass"]  # fmt: skip
    noise = {name: 1.5 * s for name, s in made.noise.items()}
    sensors: dict[str, Any] = {
        "motor_current": {"at": "armature", "unit": "A", "offset": "current_offset"},
        "motor_speed": {"at": "shaft", "unit": "rad/s"},
        "actuator_position": {"at": "moved", "unit": place, "integrates": True, "state": "way"},
    }
    residuals: dict[str, Any] = {
        "motor_temperature": {"kind": "prediction", "channel": "motor_temperature",
                              "model": "stand", "neglected": ["copper_per_kelvin"],
                              "unit": "degC"},
        "parity_mechanical": {"kind": "junction", "junction": "moved", "unit": force},
        "parity_mechanical_dn": {"kind": "junction", "junction": "moved", "normalised": True,
                                 "unit": force},
        "parity_speed": {"kind": "difference", "channel": "motor_speed", "signs": False,
                         "reference": "actuator_position", "unit": f"{place}/s"},
    }  # fmt: skip
    base = {
        "force_constant_n_per_a": "torque_constant/gear_ratio",
        "back_emf_v_s_per_m": "back_emf_constant/gear_ratio",
        "winding_resistance_ohm": "winding_resistance",
        "copper_per_kelvin": "copper_per_kelvin",
        "reference_temperature_degc": "winding_reference_temperature",
        "current_offset_a": "current_offset",
        "coulomb_friction_n": "coulomb_friction",
        "viscous_friction_n_s_per_m": "viscous_friction",
        "stribeck_speed_m_s": "smooth_speed",
        "reflected_mass_kg": "moved_inertia",
        "encoder_m_per_rad": "gear_ratio",
        "motor_heating_k_per_a2s": "winding_heat_share*winding_resistance/motor_capacity",
        "motor_capacity_j_per_k": "motor_capacity",
    }
    fixed = {"way": made.centre, "T_motor": 30.0}
    top: dict[str, Any] = {}
    holds = n.weight / n.constant
    if turns:
        level, upright = (n.weight * sheet["weight"] * x for x in _turned(n.level))
        p |= {"weight_level": (level, force), "weight_upright": (upright, force)}
        p["angle_offset"] = (0.0, "rad")
        elements["weight"] = {"type": "C", "law": "link_weight", "state": "lifted",
                              "parameters": {"level": "weight_level",
                                             "upright": "weight_upright"}}  # fmt: skip
        base |= {"weight_level_n_m": "weight_level", "weight_upright_n_m": "weight_upright"}
        base["position_offset_m"] = "angle_offset"
        fixed["lifted"] = made.centre
        sensors["load_position"] = {"at": "moved", "unit": "rad", "integrates": True,
                                    "state": "far_way"}  # fmt: skip
        fixed["far_way"] = made.centre
        residuals["parity_kinematic"] = {
            "kind": "difference", "channel": "actuator_position", "reference": "load_position",
            "offset": "angle_offset", "unit": "rad",
        }  # fmt: skip
        top["free_per_run"] = ["weight_level_n_m", "weight_upright_n_m", "reflected_mass_kg"]
    else:
        p |= {"weight": (n.weight * sheet["weight"], "N"), "bus_level": (n.supply, "V"),
              "drive_gain": (1.0, "1"), "drive_offset": (0.0, "V"),
              "voltage_offset": (0.0, "V")}  # fmt: skip
        weighs = {"type": "Se", "law": "constant_effort", "parameters": {"level": "weight"}}
        elements["weight"] = weighs
        elements["mains"] = {**weighs, "parameters": {"level": "bus_level"}}
        elements["drive"] = {"type": "MSe", "law": "gain", "signal": "commanded_voltage",
                             "parameters": {"gain": "drive_gain"}}  # fmt: skip
        junctions["link"] = ("0", "electrical")
        bonds.append("mains -> link")
        base |= {
            "weight_n": "weight",
            "bus_level_v": "bus_level",
            "drive_gain": "drive_gain",
            "drive_offset_v": "drive_offset",
            "voltage_offset_v": "voltage_offset",
        }
        sensors["motor_voltage"] = {"at": "terminals", "unit": "V", "offset": "voltage_offset"}
        sensors["bus_voltage"] = {"at": "link", "unit": "V"}
        residuals["parity_electrical"] = {"kind": "junction", "junction": "armature", "unit": "V"}
        residuals["parity_electrical_dn"] = {
            **residuals["parity_electrical"], "normalised": True, "motion": "shaft",
        }  # fmt: skip
        residuals["parity_supply"] = {
            "kind": "difference", "channel": "bus_voltage", "offset": "bus_level", "unit": "V",
        }  # fmt: skip
        residuals["parity_drive"] = {
            "kind": "difference", "channel": "motor_voltage", "reference": "commanded_voltage",
            "gain": "drive_gain", "offset": "drive_offset", "supplied_by": "mains", "unit": "V",
        }  # fmt: skip
        top["supplies"] = {
            "mains": {"channel": "bus_voltage", "low": 0.93 * n.supply, "high": 1.07 * n.supply}
        }
        top["free_per_run"] = ["weight_n", "reflected_mass_kg"]
    sensors["motor_temperature"] = {"at": "motor_node", "unit": "degC"}
    for name, row in sensors.items():
        row["noise"] = max(noise[name], 1e-7)
    given = "commanded_current" if turns else "commanded_voltage"
    tolerances: dict[str, Any] = {
        "coulomb_friction_n": "20 %", "viscous_friction_n_s_per_m": "20 %",
        "reflected_mass_kg": "5 %", "winding_resistance_ohm": "4 %", "back_emf_v_s_per_m": "2.5 %",
        "current_offset_a": 0.01 * holds, "thermal_rate_k_per_s": 0.03,
    }  # fmt: skip
    return {
        "schema_version": 1,
        "name": made.name,
        "scan_period_s": 0.01,
        "parameters": {k: {"value": float(v), "unit": u} for k, (v, u) in p.items()},
        "junctions": {k: {"type": t, "domain": d} for k, (t, d) in junctions.items()},
        "elements": elements,
        "bonds": bonds,
        "sensors": sensors,
        "inputs": {given: {"unit": "A" if turns else "V"}},
        "operating_point": {
            "hold": {"motor_current": 1.2 * holds, "motor_speed": 0.4 * made.fast / ratio},
            "by": [given, "speed"],
            "fixed": fixed,
        },
        "residuals": residuals,
        "predicted": {"winding_temperature": "motor_temperature"},
        "tolerances": tolerances,
        "base_parameters": base,
        "travel": {"at": "moved", "low_m": 0.0, "high_m": 4.0 * made.reach},
        **top,
    }


def _turned(level: float) -> tuple[float, float]:
    """cos(q - level) as shares of cos(q) and sin(q)."""
    return math.cos(level), math.sin(level)


def catalogue(made: Foreign) -> dict[str, Any]:
    """Faults of such a machine, in the parameters of its description."""
    dry = {"name": "coulomb drag", "unit": "N", "moves": {"coulomb_friction_n": 1}}
    viscous = {"name": "viscous drag", "unit": "N s/m", "moves": {"viscous_friction_n_s_per_m": 1}}

    def share(scales: dict[str, float], high: float) -> dict[str, Any]:
        return {"name": "share", "unit": "1", "scales": scales, "high": high}

    def row(hypotheses: list[list[str]], *sizes: dict[str, Any]) -> dict[str, Any]:
        return {
            "component": made.name, "hypotheses": hypotheses, "approach": "physics",
            "onset": "any", "size": 0.5, "vibration": False, "excitation": "motion",
            "effects": [{"roughness": [0.0, 0.3], "sizes": list(sizes)}],
        }  # fmt: skip

    motor = {"torque_constant": -1.0, "back_emf_constant": -1.0}
    faults: dict[str, Any] = {
        "jam": row([["coulomb_friction+", "viscous_friction+"]],
                   {**dry, "of": "coulomb_friction_n", "least": 0.5}, viscous),
        "gear_friction": row([["viscous_friction+", "coulomb_friction+"]],
                             {**dry, "of": "coulomb_friction_n", "high": 1.5},
                             {**viscous, "of": "viscous_friction_n_s_per_m", "least": 0.3}),
        "winding_resistance_rise": row([["winding_resistance+"]],
                                       share({"winding_resistance": 1.0}, 2.0)),
        "magnet_loss": row([["torque_constant-", "back_emf_constant-"]], share(motor, 0.6)),
    }  # fmt: skip
    if not made.arm:
        volts = {"name": "volts lost", "unit": "V", "moves": {"bus_level_v": -1},
                 "high": 0.8 * made.numbers.supply}  # fmt: skip
        faults |= {
            "winding_short": row([["winding_resistance-", "torque_constant-",
                                   "back_emf_constant-"]],
                                 share({"winding_resistance": -1.0, **motor}, 0.7)),
            "weak_drive": row([["drive_gain-"]], share({"drive_gain": -1.0}, 0.7)),
            "supply_sag": row([["bus_level-"]], volts),
        }  # fmt: skip
    none = {"approach": "physics", "onset": "any", "excitation": "none"}
    modes = ("bias", "drift", "scaling", "dead", "noise", "dropout")
    full = {"motor_current": made.numbers.limit, "motor_voltage": made.numbers.supply,
            "bus_voltage": made.numbers.supply, "motor_speed": 2.0 * made.fast / made.ratio,
            "motor_temperature": 60.0}  # fmt: skip
    errors = {}
    for name in made.channels:
        if name != "commanded_voltage":
            most = float(full.get(name, 2.0 * made.reach))
            errors[name] = {"bias": most, "drift": 0.1 * most}
            if name == "actuator_position":
                errors[name]["drift_as_speed"] = 0.1 * made.fast
    return {"schema_version": 1, "faults": faults, "sensor_modes": dict.fromkeys(modes, none),
            "sensor_errors": errors}  # fmt: skip
