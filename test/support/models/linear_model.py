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

"""A linear filter model, for which the Kalman filter is exact; discretised without the package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from flea_diag.core.bond_graph.state_space import Linear, StateSpace

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LinearModel:
    """x' = A x + B u + w, y = H x + D u + h + v; a ``FilterModel``.

    A (n, n), B (n, m), H (p, n), D (p, m), h (p,), Q (n, n), R (p, p).
    """

    states: tuple[str, ...]
    channels: tuple[str, ...]
    inputs: tuple[str, ...]
    A: Array
    B: Array
    H: Array
    D: Array
    h: Array
    Q: Array
    R: Array

    @property
    def driving(self) -> npt.NDArray[np.bool_]:
        """No channel stands for an input."""
        return np.zeros(len(self.channels), dtype=bool)

    @property
    def linear(self) -> tuple[Array, Array]:
        """A and B."""
        return self.A, self.B

    def transition(self, x: Array, u: Array) -> Array:
        """(n, N) and (m,) -> (n, N); an input that is NaN counts as zero."""
        moved: Array = self.A @ x + (self.B @ np.nan_to_num(u))[:, None]
        return moved

    def linearised(self, x: Array, u: Array) -> tuple[Array, Array]:
        """A, wherever."""
        return self.transition(x[:, None], u)[:, 0], self.A

    def process_noise(self, u: Array) -> Array:
        """Q, always."""
        return self.Q


def linear_model(
    space: StateSpace,
    period_s: float,
    channels: Mapping[str, float],
    inputs: Mapping[str, float],
    rates: Mapping[str, float],
) -> LinearModel:
    """Equations about zero, exact in time, with these standard deviations.

    ``rates`` are of white noise on the rate of change of a state, per root of a second.
    """
    x, u = np.zeros(len(space.states)), np.zeros(len(space.inputs))
    about, m = space.linearise(x, u), len(u)
    # What the equations do at zero itself enters as one more held input of value one.
    rest = space.derivatives(x, u)
    held = Linear(about.a, np.column_stack((about.b, rest)), about.c, about.d)
    Ad, Bd = hold(held, period_s)
    volts, walks, reads = (
        np.diag([levels.get(name, 0.0) ** 2 for name in names])
        for names, levels in (
            (space.inputs, inputs),
            (space.states, rates),
            (space.outputs, channels),
        )
    )
    Q = Bd[:, :m] @ volts @ Bd[:, :m].T + process_noise(about.a, walks, period_s)
    d = np.column_stack((about.d, np.zeros(len(about.c))))
    names = space.states, space.outputs, (*space.inputs, "one")
    return LinearModel(*names, Ad, Bd, about.c, d, space.measure(x, u), Q, reads)


def hold(linear: Linear, period_s: float) -> tuple[Array, Array]:
    """Exact zero-order hold: x(t+T) = Ad x(t) + Bd u, shapes (n, n) and (n, m).

    Both come from one exponential of [[A, B], [0, 0]] T (Van Loan 1978), so A may be singular.
    """
    n, m = linear.b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = linear.a, linear.b
    grown = expm(block * period_s)
    return grown[:n, :n], grown[:n, n:]


def process_noise(a: Array, intensity: Array, period_s: float) -> Array:
    """Covariance accumulated over one period from white noise of this intensity, (n, n)."""
    n = len(a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, intensity, a.T
    grown = expm(block * period_s)
    noise: Array = grown[n:, n:].T @ grown[:n, n:]
    return (noise + noise.T) / 2
