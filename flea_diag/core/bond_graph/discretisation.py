"""From continuous time to scans; stable for time constants below the scan period.

An Euler step of 10 ms over a time constant of 4 ms diverges. The linear part is therefore
integrated by matrix exponentials, exact for inputs held over the period. The nonlinear rest
(smooth Coulomb friction, dissipation) uses the two-stage exponential Runge-Kutta rule of
second order, with as many substeps as its stiffness requires (Cox and Matthews 2002, ETD2RK).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.state_space import Linear, StateSpace

Array = npt.NDArray[np.float64]

STABLE = 0.5
"""Largest substep times the rate of the nonlinear part; the explicit stage is stable below 2."""


def expm(matrix: Array) -> Array:
    """Matrix exponential (scipy's, imported on first use)."""
    from scipy.linalg import expm as scipy_expm

    result: Array = scipy_expm(matrix)
    return result


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


def phi_functions(a: Array, step_s: float) -> tuple[Array, Array]:
    """phi1(Ah) = (e^Ah - 1)/(Ah) and phi2(Ah) = (phi1 - 1)/(Ah), safe for singular A."""
    n = len(a)
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n] = a * step_s
    block[:n, n : 2 * n] = block[n : 2 * n, 2 * n :] = np.eye(n)
    grown = expm(block)
    return grown[:n, n : 2 * n], grown[:n, 2 * n :]


@dataclass(frozen=True)
class ScanStep:
    """One scan period of a nonlinear model, for (N, n) particles at once."""

    model: StateSpace
    period_s: float
    substeps: int
    a: Array
    h_phi1: Array
    h_phi2: Array

    def __call__(self, x: Array, u: Array, p: Array | None = None) -> Array:
        """States one period later, shape (..., n), inputs held."""
        a, phi1, phi2 = self.a.T, self.h_phi1.T, self.h_phi2.T
        for _ in range(self.substeps):
            rate = self.model.derivatives(x, u, p)
            stage = x + rate @ phi1
            curvature = self.model.derivatives(stage, u, p) - rate - (stage - x) @ a
            x = stage + curvature @ phi2
        return x


def scan_step(
    model: StateSpace,
    period_s: float,
    x: Array,
    u: Array,
    substeps: int | None = None,
) -> ScanStep:
    """Step of a model about an operating point ``x``, shape (n,), ``u``, shape (m,).

    The operating point only selects the linear part that is integrated exactly; the step follows
    the full equations everywhere. Without ``substeps`` their number follows from the stiffest
    nonlinear term: the largest change of the Jacobian between the point and standstill.
    """
    a = model.linearise(x, u).a
    if substeps is None:
        still = model.linearise(np.zeros_like(x), u).a
        rate = max(np.max(np.abs(np.linalg.eigvals(still - a))), 0.0)
        substeps = max(1, math.ceil(period_s * rate / STABLE))
    step = period_s / substeps
    phi1, phi2 = phi_functions(a, step)
    return ScanStep(model, period_s, substeps, a, step * phi1, step * phi2)
