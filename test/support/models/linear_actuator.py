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

"""A linear actuator to filter on: the bond graph's EMA without Coulomb friction, and its truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flea_diag.configuration.files import load_yaml
from flea_diag.core.bond_graph.actuator import actuator
from support.models.linear_model import LinearModel, linear_model

PERIOD = 0.01
START = np.diag([0.1, 1.0, 1e-8])


def model() -> LinearModel:
    """Current (A), speed (rad/s, hidden) and position (m); current and position measured."""
    ema = actuator(load_yaml("actuator.yaml")).with_parameters({"screw_coulomb_friction": 0.0})
    space = ema.state_space("driven", ["motor_current", "actuator_position"])
    return linear_model(
        space,
        PERIOD,
        channels={"motor_current": 0.053, "actuator_position": 6e-5},
        inputs={"motor_voltage": 1.0, "load_force": 20.0},
        rates={"i": 0.2, "omega": 10.0, "x_nut": 1e-4},
    )


def sharpened(given: LinearModel, factor: float) -> LinearModel:
    """Sensors so many times better than what the process noise does to them in one scan."""
    moved = np.diag(given.H @ given.Q @ given.H.T)
    return replace(given, R=np.diag(moved) / factor**2)


def simulated(given: LinearModel, steps: int, seed: int) -> tuple[np.ndarray, ...]:
    """States, inputs and measurements of one run, started from N(0, START)."""
    draw = np.random.default_rng(seed)
    zero = np.zeros(3)
    x = draw.multivariate_normal(zero, START)
    X, U, Y = [], [], []
    for k in range(steps):
        u = np.array([10.0 * np.sin(k / 30), 100.0 * np.cos(k / 50), 1.0])
        x = given.A @ x + given.B @ u + draw.multivariate_normal(zero, given.Q)
        X.append(x)
        U.append(u)
        noise = draw.multivariate_normal(np.zeros(len(given.R)), given.R)
        Y.append(given.H @ x + given.D @ u + given.h + noise)
    return np.array(X), np.array(U), np.array(Y)
