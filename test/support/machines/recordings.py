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

"""The stand of a random machine, and recordings that obey its description."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from scipy.integrate import solve_ivp

from flea_diag.core.bond_graph.actuator_model import Actuator
from support.machines.description import PERIOD_S

Array = npt.NDArray[np.float64]
RUNS, SPAN_S = 3, 20.0
START = "2020-01-01T00:00:00Z"


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
    for mode in content["modes"].values():
        columns[mode["channel"]] = {"column": mode["channel"], "unit": "1", "range": [-1.0, 2.0]}
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
    for mode in model.modes.values():
        since = np.linspace(0.0, 1.0, len(readings))
        columns[mode.channel] = ((since > 0.4) & (since < 0.6)).astype(float)
    for name in model.inputs:
        place = space.inputs.index(name) if name in space.inputs else -1
        columns[name] = driven[:, place] if place >= 0 else np.full(len(readings), 22.0)
        if name in model.sensors:
            columns[name] = columns[name] + model.sensors[name].noise * rng.standard_normal(
                len(readings)
            )
    return columns
