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

"""Parts of a random machine: drive, winding, motor, gear, friction, load and heat."""

from __future__ import annotations

from typing import Any

from support.machines.draft import Draft


def circuit(draft: Draft) -> str:
    """Supply and winding; the input that drives them."""
    draft.junction("terminals", "0", "electrical")
    draft.junction("armature", "1", "electrical")
    draft.bonds.append("terminals -> armature")
    kind = draft.one_of("voltage", "gain", "current")
    name = {"voltage": "applied_voltage", "gain": "commanded_voltage"}.get(
        kind, "commanded_current"
    )
    source: dict[str, Any] = {"type": "MSf" if kind == "current" else "MSe", "signal": name}
    if kind == "gain":
        draft.constant("drive_gain", 1.0, "1")
        draft.constant("drive_offset", 0.0, "V")
        source |= {"law": "gain", "parameters": {"gain": "drive_gain"}}
        draft.base |= {"drive_gain": "drive_gain", "drive_offset_v": "drive_offset"}
    draft.element("supply", "terminals", source=True, **source)
    draft.inputs[name] = {"unit": "A" if kind == "current" else "V"}
    _winding(draft)
    if kind != "current" and draft.may(0.4):
        draft.parameter("winding_inductance", 2e-3, "H")
        draft.element(
            "inductance",
            "armature",
            type="I",
            state="i",
            parameters={"inertia": "winding_inductance"},
        )
        draft.base["winding_inductance_h"] = "winding_inductance"
    if draft.may(0.3):
        draft.parameter("bridge_drop", 0.4, "V")
        draft.constant("bridge_current", 0.2, "A")
        roles = {"level": "bridge_drop", "smooth_flow": "bridge_current"}
        draft.element("bridge", "armature", type="R", law="dry", parameters=roles)
        draft.base["drive_drop_v"] = "bridge_drop"
    return name


def _winding(draft: Draft) -> None:
    draft.parameter("winding_resistance", 1.0, "ohm")
    draft.base["winding_resistance_ohm"] = "winding_resistance"
    row: dict[str, Any] = {"type": "R", "parameters": {"resistance": "winding_resistance"}}
    if draft.may():
        draft.constant("copper", 3.93e-3, "1/K")
        draft.constant("cold", 25.0, "degC")
        draft.constant("winding_temperature", 25.0, "degC")
        roles = {"per_kelvin": "copper", "reference": "cold", "temperature": "winding_temperature"}
        row = {**row, "law": "warm_resistance", "parameters": {**row["parameters"], **roles}}
        draft.base |= {"copper_per_kelvin": "copper", "reference_temperature_degc": "cold"}
    draft.element("winding", "armature", **row)


def mechanics(draft: Draft) -> str:
    """Motor, gear, friction, load; the junction of the part that the position is read of."""
    draft.parameter("back_emf_constant", 0.2, "V*s/rad")
    draft.parameter("torque_constant", 0.2, "N*m/A")
    roles = {"back_emf": "back_emf_constant", "torque": "torque_constant"}
    draft.junction("shaft", "1", "rotation")
    draft.elements["motor"] = {"type": "GY", "law": "motor", "parameters": roles}
    draft.bonds += ["armature -> motor", "motor -> shaft"]
    gear = draft.one_of("none", "screw", "reduction")
    moved, ratio = "shaft", ""
    if gear != "none":
        moved, ratio = "carriage", "/ratio"
        domain, unit = ("translation", "m/rad") if gear == "screw" else ("rotation", "1")
        draft.parameter("ratio", 5e-3 if gear == "screw" else 0.02, unit)
        draft.junction("carriage", "1", domain)
        draft.elements["gear"] = {"type": "TF", "parameters": {"ratio": "ratio"}}
        draft.bonds += ["shaft -> gear", "gear -> carriage"]
        draft.base["encoder_m_per_rad"] = "ratio"
    draft.base["force_constant_n_per_a"] = f"torque_constant{ratio}"
    draft.base["back_emf_v_s_per_m"] = f"back_emf_constant{ratio}"
    draft.parameter("rotor_inertia", 1e-3, "kg*m^2")
    draft.element(
        "rotor", "shaft", type="I", state="omega", parameters={"inertia": "rotor_inertia"}
    )
    if moved != "shaft":
        unit = "N*s/m" if gear == "screw" else "N*m*s/rad"
        roles = {"resistance": draft.parameter("rail_friction", 1e-3, unit)}
        draft.element("rail", moved, type="R", parameters=roles)
    squared = "/ratio^2" if ratio else ""
    draft.base["reflected_mass_kg"] = f"rotor_inertia{squared}"
    _load(draft, moved, draft.junctions[moved]["domain"])
    _friction(draft, ratio, squared)
    return moved


def _friction(draft: Draft, ratio: str, squared: str) -> None:
    law = draft.one_of(
        "friction", "friction", "stribeck", "dry", "loaded_friction", "warm_friction", "resistance"
    )
    if law == "warm_friction" and "node_0" not in draft.junctions:
        law = "friction"
    if law == "loaded_friction" and "cell" not in draft.junctions:
        law = "friction"
    roles = {"smooth_flow": draft.constant("smooth_speed", 2.0, "rad/s")}
    if law != "resistance":
        roles["level" if law == "dry" else "coulomb"] = draft.parameter("dry_friction", 0.05, "N*m")
        draft.base["coulomb_friction_n"] = f"dry_friction{ratio}"
    if law not in ("dry", "resistance"):
        roles["viscous"] = draft.parameter("viscous_friction", 2e-3, "N*m*s/rad")
        draft.base["viscous_friction_n_s_per_m"] = f"viscous_friction{squared}"
    if law == "stribeck":
        roles["breakaway"] = draft.parameter("breakaway", 0.08, "N*m")
        draft.base["breakaway_n"] = f"breakaway{ratio}"
        roles["stribeck_flow"] = draft.constant("stribeck_speed", 8.0, "rad/s")
    row: dict[str, Any] = {"type": "R", "law": law, "parameters": roles}
    if law == "resistance":
        row["parameters"] = {"resistance": draft.parameter("viscous_friction", 3e-3, "N*m*s/rad")}
        draft.parameters.pop("smooth_speed")
        draft.base["viscous_friction_n_s_per_m"] = f"viscous_friction{squared}"
    else:
        draft.base["stribeck_speed_m_s"] = "smooth_speed" + ("*ratio" if ratio else "")
    if law == "warm_friction":
        roles["per_kelvin"] = draft.constant("friction_per_kelvin", -5e-3, "1/K")
        roles["reference"] = draft.constant("friction_reference", 25.0, "degC")
        row["modulated_by"] = "node_0"
        if draft.may():
            draft.base["friction_per_kelvin"] = "friction_per_kelvin"
    if law == "loaded_friction":
        unit = "m" if draft.junctions["cell"]["domain"] == "translation" else "1"
        roles["load_share"] = draft.parameter("load_friction", 1e-4, unit)
        row["modulated_by"] = "cell"
        draft.base["load_friction_ratio"] = f"load_friction{ratio}"
    draft.element("rubbing", "shaft", **row)


def _load(draft: Draft, moved: str, domain: str) -> None:
    unit = "N" if domain == "translation" else "N*m"
    if draft.may(0.4):
        draft.junction("cell", "0", domain)
        draft.element("load", "cell", type="MSe", signal="commanded_load")
        draft.bonds.append(f"{moved} -> cell")
        draft.inputs["commanded_load"] = {"unit": unit}
    if unit == "N*m" and draft.may(0.4):
        roles = {"level": draft.parameter("arm_weight", 0.03, unit), "upright": "arm_ahead"}
        draft.constant("arm_ahead", 0.0, unit)
        draft.element(
            "arm", moved, type="C", law="link_weight", state="arm_angle", parameters=roles
        )
        draft.fixed["arm_angle"] = 0.1
        draft.base |= {"arm_weight_n": "arm_weight", "arm_ahead_n": "arm_ahead"}
    elif draft.may(0.3):
        draft.parameter("weight", 8.0 if unit == "N" else 0.05, unit)
        draft.element(
            "gravity", moved, type="Se", law="constant_effort", parameters={"level": "weight"}
        )
        if draft.may():
            draft.base["weight_n"] = "weight"


def heat(draft: Draft) -> None:
    """No store, or up to three in a row, with or without the air around the last."""
    count = int(draft.rng.integers(4))
    if not count:
        return
    draft.constant("share", 1.0, "1")
    powers = ["winding", "rubbing"] if draft.may(0.2) else ["winding"]
    for number in range(count):
        draft.junction(f"node_{number}", "0", "thermal")
        draft.parameter(f"capacity_{number}", 200.0, "J/K")
        draft.element(
            f"mass_{number}",
            f"node_{number}",
            type="C",
            law="capacity",
            state=f"T_{number}",
            parameters={"capacity": f"capacity_{number}"},
        )
        draft.fixed[f"T_{number}"] = 30.0
        if number:
            _path(draft, number, f"node_{number - 1}", f"node_{number}")
    draft.element(
        "heat", "node_0", source=True, type="MSf", law="dissipation", powers=powers,
        parameters={"share": "share"},
    )  # fmt: skip
    if draft.may(0.7):
        _path(draft, count, f"node_{count - 1}", "")
        draft.inputs["ambient_temperature"] = {"unit": "degC", "noise": 0.05, "sensor": True}
        draft.fixed["ambient_temperature"] = 22.0
    first = "motor_heating_k_per_a2s"
    draft.base[first] = "share*winding_resistance/capacity_0"
    if "path_1" in draft.elements:
        draft.base["motor_cooling_s"] = "capacity_0*path_resistance_1"
        draft.base["motor_capacity_j_per_k"] = "capacity_0"
    if count > 1:
        draft.base["housing_cooling_s"] = "capacity_1*path_resistance_1"
    if count > 1 and "path_2" in draft.elements and draft.may():
        draft.base["outer_cooling_s"] = "capacity_1*path_resistance_2"


def _path(draft: Draft, number: int, hot: str, cold: str) -> None:
    place = f"between_{number}"
    draft.junction(place, "1", "thermal")
    draft.parameter(f"path_resistance_{number}", 0.5, "K/W")
    draft.bonds.append(f"{hot} -> {place}")
    draft.element(
        f"path_{number}", place, type="R", parameters={"resistance": f"path_resistance_{number}"}
    )
    if cold:
        draft.bonds.append(f"{place} -> {cold}")
    else:
        draft.element("air", place, type="Se", signal="ambient_temperature")
