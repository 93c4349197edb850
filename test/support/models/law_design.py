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

"""A law of one or two relations, with columns that a test can work out on paper."""

from __future__ import annotations

import numpy as np

from flea_diag.core.run_law.fault_columns import FaultColumn, FaultColumns
from flea_diag.core.run_law.law_columns import FREE, UNIT, LawColumn, LawColumns
from flea_diag.core.run_law.run_windows import RunWindows

SIGNALS = ("one", "elapsed_s", "x")
RELATIONS = ("balance", "circuit")
COLUMNS = LawColumns(
    RELATIONS,
    (LawColumn("drag", UNIT, 1.0), LawColumn("zero", FREE, 0.5)),
    # The drag acts by x in the balance; the zero is a constant in both.
    np.array([[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]], [[0.0, 2.0], [0.0, 0.0], [0.0, 0.0]]]),
    1,
)
FAULTS = FaultColumns(
    (
        FaultColumn("jam", "drag", "N", 0.0, np.inf),
        FaultColumn("circuit_bias", "bias", "V", -9.0, 9.0),
    ),
    np.array([[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]]),
    1,
)


def recording(
    rng: np.random.Generator,
    coefficients: tuple[float, float],
    windows: int = 120,
    sigma: float = 0.2,
    name: str = "run",
    unit: str = "",
) -> RunWindows:
    """A healthy recording with these coefficients and white noise, x swinging between -1 and 1."""
    x = np.sin(np.arange(windows) / 3.0 + rng.uniform(0.0, 6.0))
    signals = np.zeros((windows, 2, 3))
    signals[:, :, 0], signals[:, :, 2] = 1.0, x[:, None]
    plain = RunWindows(name, unit, np.zeros((windows, 2)), signals, np.zeros((windows, 5)))
    noise = sigma * rng.standard_normal((windows, 2))
    values = COLUMNS.of(plain) @ np.array(coefficients) + noise
    return RunWindows(name, unit, values, signals, plain.motion)


def recordings(
    rng: np.random.Generator, count: int, run_sigma: tuple[float, float] = (0.3, 0.1)
) -> list[RunWindows]:
    """Healthy recordings of one unit that differ by these deviations."""
    drawn = rng.standard_normal((count, 2)) * run_sigma
    return [recording(rng, (d, z), name=f"run_{k}") for k, (d, z) in enumerate(drawn.tolist())]
