"""What a filter runs on: linear models, and models of an actuator's own state equations.

``linear_model`` and ``graph_model`` take the equations that the bond graph gives
(``Actuator.state_space``); the model in linear coordinates, from calibrated parameters, is
``driven_model``. All discretise exactly for inputs held over a scan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from flea_diag.core.bond_graph.discretisation import ScanStep, hold, scan_step
from flea_diag.core.bond_graph.discretisation import process_noise as gathered
from flea_diag.core.bond_graph.state_space import Linear, StateSpace
from flea_diag.errors import ConfigurationError

Array = npt.NDArray[np.float64]
Transition = Callable[[Array, Array], Array]


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

    def jacobian(self, x: Array, u: Array) -> Array:
        """A, wherever."""
        return self.A

    def process_noise(self, u: Array) -> Array:
        """Q, always."""
        return self.Q


@dataclass(frozen=True)
class GraphModel:
    """A bond graph's own equations over one scan; a ``FilterModel``."""

    space: StateSpace
    step: ScanStep
    H: Array
    h: Array
    D: Array
    Q: Array
    R: Array

    @property
    def states(self) -> tuple[str, ...]:
        """Of the state space."""
        return self.space.states

    @property
    def channels(self) -> tuple[str, ...]:
        """Of the state space."""
        return self.space.outputs

    @property
    def inputs(self) -> tuple[str, ...]:
        """Of the state space."""
        return self.space.inputs

    @property
    def driving(self) -> npt.NDArray[np.bool_]:
        """No channel stands for an input."""
        return np.zeros(len(self.channels), dtype=bool)

    @property
    def linear(self) -> None:
        """It is not."""
        return None

    def transition(self, x: Array, u: Array) -> Array:
        """(n, N) and (m,) -> (n, N)."""
        return np.ascontiguousarray(self.step(x.T, u).T)

    def jacobian(self, x: Array, u: Array) -> Array:
        """By central differences, (n, n)."""
        return difference_jacobian(self.transition, x, u)

    def process_noise(self, u: Array) -> Array:
        """Q, always."""
        return self.Q


def difference_jacobian(transition: Transition, x: Array, u: Array) -> Array:
    """Partial derivatives of a transition by central differences, (n,) -> (n, n)."""
    steps = 1e-6 * np.maximum(1.0, np.abs(x))
    shifts = np.diag(steps)
    both = x[:, None] + np.concatenate((shifts, -shifts), axis=1)
    moved = transition(both, u)
    n = len(x)
    slopes: Array = (moved[:, :n] - moved[:, n:]) / (2.0 * steps)
    return slopes


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations that a model from a bond graph is given.

    ``inputs`` of a held input in one scan; ``rates`` of white noise on a state's rate of
    change (state's unit / sqrt(s)); ``channels`` of one reading.
    """

    channels: Mapping[str, float]
    inputs: Mapping[str, float] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


def linear_model(
    space: StateSpace,
    x: Array,
    u: Array,
    period_s: float,
    noise: NoiseLevels,
) -> LinearModel:
    """Equations linearised about one point, (n,) and (m,), exact in time.

    Raises
    ------
    ConfigurationError
        A channel without noise, or noise of something that the model does not have.
    """
    about = space.linearise(x, u)
    m = about.b.shape[1]
    # What the equations do at the point itself enters as one more held input of value one.
    rest = space.derivatives(x, u) - about.a @ x - about.b @ u
    Ad, Bd = hold(Linear(about.a, np.column_stack((about.b, rest)), about.c, about.d), period_s)
    Q, R = _covariances(space, about, Bd[:, :m], period_s, noise)
    return LinearModel(
        space.states,
        space.outputs,
        (*space.inputs, "one"),
        Ad,
        Bd,
        about.c,
        np.column_stack((about.d, np.zeros(len(about.c)))),
        space.measure(x, u) - about.c @ x - about.d @ u,
        Q,
        R,
    )


def graph_model(
    space: StateSpace, x: Array, u: Array, period_s: float, noise: NoiseLevels
) -> GraphModel:
    """Full equations of the actuator; the point only fixes noise and the linear part.

    Raises
    ------
    ConfigurationError
        As ``linear_model``, and a measurement that is not linear in the states.
    """
    about = space.linearise(x, u)
    other = space.linearise(x + 1.0, u + 1.0)
    if not (np.allclose(about.c, other.c) and np.allclose(about.d, other.d)):
        raise ConfigurationError(
            f"a channel of {', '.join(space.outputs)} is not linear in the states: "
            "choose channels that are, a filter needs y = H x"
        )
    _, Bd = hold(about, period_s)
    Q, R = _covariances(space, about, Bd, period_s, noise)
    h = space.measure(x, u) - about.c @ x - about.d @ u
    return GraphModel(space, scan_step(space, period_s, x, u), about.c, h, about.d, Q, R)


def _covariances(
    space: StateSpace, about: Linear, Bd: Array, period_s: float, noise: NoiseLevels
) -> tuple[Array, Array]:
    inputs = _levels(space.inputs, noise.inputs, "input")
    rates = _levels(space.states, noise.rates, "state")
    channels = _levels(space.outputs, noise.channels, "channel")
    if not (channels > 0.0).all():
        name = space.outputs[int(np.argmin(channels))]
        raise ConfigurationError(f"noise of channel {name!r} must be above 0: give its sigma")
    Q = Bd @ np.diag(inputs**2) @ Bd.T + gathered(about.a, np.diag(rates**2), period_s)
    return Q, np.diag(channels**2)


def _levels(names: Sequence[str], given: Mapping[str, float], kind: str) -> Array:
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise ConfigurationError(
            f"noise of {kind} {unknown[0]!r}: the model has {', '.join(names) or 'none'}"
        )
    return np.array([float(given.get(name, 0.0)) for name in names])
