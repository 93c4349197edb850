"""Random machines: a description, a catalogue and recordings that obey the description.

A machine is drawn part by part: drive, winding, motor, gear, friction, load, heat, sensors. Nothing
in it is tuned, and much of it is of no use; every command must take it, or refuse it in one line.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from scipy.integrate import solve_ivp

from flea_diag.core.bond_graph.actuator_model import Actuator

Array = npt.NDArray[np.float64]
RUNS, SPAN_S, PERIOD_S = 3, 20.0, 0.02
SEEN = ("winding_resistance", "back_emf_constant", "dry_friction", "viscous_friction")
"""Parameters that most sensors see."""
START = "2020-01-01T00:00:00Z"


@dataclass
class Draft:
    """A description as it grows."""

    rng: np.random.Generator
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    junctions: dict[str, dict[str, str]] = field(default_factory=dict)
    elements: dict[str, dict[str, Any]] = field(default_factory=dict)
    bonds: list[str] = field(default_factory=list)
    sensors: dict[str, dict[str, Any]] = field(default_factory=dict)
    inputs: dict[str, dict[str, Any]] = field(default_factory=dict)
    residuals: dict[str, dict[str, Any]] = field(default_factory=dict)
    base: dict[str, str] = field(default_factory=dict)
    fixed: dict[str, float] = field(default_factory=dict)
    predicted: dict[str, str] = field(default_factory=dict)

    def may(self, share: float = 0.5) -> bool:
        """A draw."""
        return bool(self.rng.random() < share)

    def one_of(self, *choices: Any) -> Any:
        """One of these."""
        return choices[int(self.rng.integers(len(choices)))]

    def parameter(self, name: str, value: float, unit: str) -> str:
        """A parameter near this value."""
        drawn = value * float(np.exp(self.rng.normal(0.0, 0.3)))
        self.parameters[name] = {"value": float(f"{drawn:.4g}"), "unit": unit}
        return name

    def constant(self, name: str, value: float, unit: str) -> str:
        """A parameter of this value."""
        self.parameters[name] = {"value": value, "unit": unit}
        return name

    def junction(self, name: str, kind: str, domain: str) -> None:
        """A junction."""
        self.junctions[name] = {"type": kind, "domain": domain}

    def element(self, name: str, at: str, *, source: bool = False, **row: Any) -> None:
        """An element at a junction."""
        self.elements[name] = row
        self.bonds.append(f"{name} -> {at}" if source else f"{at} -> {name}")


def random_description(rng: np.random.Generator) -> dict[str, Any]:
    """One description, under ``faults`` its catalogue, and what no recording has (``unread``)."""
    draft = Draft(rng)
    driven = _circuit(draft)
    moved = _mechanics(draft)
    _heat(draft)
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
    return {
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


def _circuit(draft: Draft) -> str:
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


def _mechanics(draft: Draft) -> str:
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
    law = draft.one_of("friction", "friction", "stribeck", "dry", "loaded_friction", "resistance")
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
        roles["stribeck_flow"] = draft.constant("stribeck_speed", 8.0, "rad/s")
    row: dict[str, Any] = {"type": "R", "law": law, "parameters": roles}
    if law == "resistance":
        row["parameters"] = {"resistance": draft.parameter("viscous_friction", 3e-3, "N*m*s/rad")}
        draft.parameters.pop("smooth_speed")
        draft.base["viscous_friction_n_s_per_m"] = f"viscous_friction{squared}"
    else:
        draft.base["stribeck_speed_m_s"] = "smooth_speed" + ("*ratio" if ratio else "")
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
    if draft.may(0.3):
        draft.parameter("weight", 8.0 if unit == "N" else 0.05, unit)
        draft.element(
            "gravity", moved, type="Se", law="constant_effort", parameters={"level": "weight"}
        )
        if draft.may():
            draft.base["weight_n"] = "weight"


def _heat(draft: Draft) -> None:
    """No store, or up to three in a row, with or without the air around the last."""
    count = int(draft.rng.integers(4))
    if not count:
        return
    draft.constant("share", 1.0, "1")
    powers = ["winding", "rubbing"] if draft.may(0.3) else ["winding"]
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


def write_stand(description: dict[str, Any], folder: Path, features: Path) -> None:
    """The folder of its stand; channels are columns of a table of their names."""
    folder.mkdir(parents=True)
    content = dict(description)
    faults, unread = content.pop("faults"), content.pop("unread")
    columns = {
        name: {
            "column": name, "unit": row["unit"],
            "range": [-1e7, 1e7] if row["unit"] != "degC" else [-50.0, 500.0],
        }
        for name, row in (*content["sensors"].items(), *content["inputs"].items())
        if name not in unread
    }  # fmt: skip
    stand = {
        "schema_version": 1, "name": "drawn", "actuator": "actuator.yaml", "faults": "faults.yaml",
        "calibration": "calibration.yaml", "features": "feature_table.yaml",
        "channels": "channels.yaml",
    }  # fmt: skip
    channels = {
        "schema_version": 1, "rate_hz": 1.0 / PERIOD_S, "channels": columns,
        "time": {"column": "t", "unit": "s", "start": START},
    }  # fmt: skip
    for name, rows in (
        ("actuator", content), ("faults", faults), ("stand", stand), ("channels", channels)
    ):  # fmt: skip
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(rows, sort_keys=False))
    (folder / "feature_table.yaml").write_text(features.read_text())


def write_recordings(
    model: Actuator, rng: np.random.Generator, folder: Path, scale: float = 1.0
) -> list[Path]:
    """Tables of healthy runs of the described machine, driven by a command that swings."""
    found = []
    for number in range(RUNS):
        columns = recorded(model, rng, scale)
        path = folder / f"run_{number}.csv"
        names = list(columns)
        rows = np.column_stack([columns[name] for name in names])
        np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
        found.append(path)
    return found


def recorded(model: Actuator, rng: np.random.Generator, scale: float = 1.0) -> dict[str, Array]:
    """Readings of one run: the state equations of the description, integrated, with noise."""
    space = model.state_space("stand", [s.channel for s in model.sensors.values() if s.at])
    levels = {"V": 12.0, "A": 2.0, "degC": 22.0, "N": 5.0, "N*m": 0.05}
    swing = {name: levels[model.inputs[name]] * scale for name in space.inputs}
    frequencies, phase = rng.uniform(0.15, 0.5, 2), rng.uniform(0.0, 6.0, 2)

    def inputs(t: float) -> Array:
        both = np.sin(frequencies * 2 * np.pi * t + phase)
        drive, load = 0.7 * both[0] + 0.3 * both[1], 1.0 + 0.5 * both[1]
        return np.array(
            [
                22.0 if model.inputs[name] == "degC"
                else swing[name] * (load if name == "commanded_load" else drive)
                for name in space.inputs
            ]
        )  # fmt: skip

    start = [25.0 if name.startswith("T_") else 0.0 for name in space.states]
    times = np.arange(0.0, SPAN_S, PERIOD_S)
    solved = solve_ivp(
        lambda t, x: space.derivatives(x, inputs(t)), (0.0, SPAN_S), start, "LSODA", times,
        rtol=1e-5, atol=1e-7,
    )  # fmt: skip
    driven = np.array([inputs(t) for t in times[: solved.y.shape[1]]])
    readings = space.measure(solved.y.T, driven)
    columns = {"t": times[: len(readings)]}
    for name, values in zip(space.outputs, readings.T, strict=True):
        columns[name] = values + model.sensors[name].noise * rng.standard_normal(len(values))
    for name in model.inputs:
        place = space.inputs.index(name) if name in space.inputs else -1
        columns[name] = driven[:, place] if place >= 0 else np.full(len(readings), 22.0)
        if name in model.sensors:
            columns[name] = columns[name] + model.sensors[name].noise * rng.standard_normal(
                len(readings)
            )
    return columns
