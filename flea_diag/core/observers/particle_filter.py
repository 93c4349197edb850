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

"""Particle filter with the optimal proposal, or the bootstrap filter in its literal form.

Narasimhan et al. 2010, section 3.1, observe by a particle filter (Arulampalam et al. 2002).
The bootstrap filter of that tutorial moves particles blindly and then weighs them: with
sensors better than the process noise hardly any of them survives. Where the measurement is
linear and the noise Gaussian the optimal proposal is known in closed form (Doucet et al.
2000): particles are weighed by how well they predicted, resampled, and moved knowing the
measurement. That is the default here.

Every step draws the same number of random bits whatever happens in it, from the generator
given, outside of the backend: numpy and numba see the same random numbers and give the same
answers up to the order of sums.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy, deepcopy
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core import backend as backends
from flea_diag.core.observers import normal_table
from flea_diag.core.observers.gaussian import square_root
from flea_diag.core.observers.particle_kernel import Views, pack, step_numpy, unpack
from flea_diag.core.observers.particle_loops import STEP
from flea_diag.core.observers.state_filter import ConsistencyMonitor, FilterModel, Innovation
from flea_diag.errors import ConfigurationError

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

PROPOSALS = ("optimal", "bootstrap")
PATTERNS = 256
"""Most patterns of missing channels in the cache; beyond, it is cleared."""


class _Pattern(NamedTuple):
    """Matrices for one pattern of measured channels, as ``particle_kernel.pack`` puts them."""

    matrices: Array | Views
    measured: int


class ParticleFilter:
    """A ``Filter`` of N particles.

    Parameters
    ----------
    model
        What it runs on.
    mean, covariance : shape (n,), (n, n)
        Gaussian from which the first particles are drawn.
    generator
        The only source of randomness, of 64 bits (``numpy.random.default_rng(seed)``).
    particles
        N, at least 2.
    proposal
        "optimal" or "bootstrap".
    threshold
        Resample when the effective sample size falls below this share of N.
    backend
        "numpy", "numba" or "auto".
    expected
        Normalised innovation squared of a channel; see ``ConsistencyMonitor``.

    Raises
    ------
    ConfigurationError
        A parameter out of its limits, by name.
    """

    def __init__(
        self,
        model: FilterModel,
        mean: Array,
        covariance: Array,
        generator: np.random.Generator,
        *,
        particles: int = 200,
        proposal: str = "optimal",
        threshold: float = 0.5,
        backend: str = "auto",
        expected: float = 1.0,
    ) -> None:
        if particles < 2:
            raise ConfigurationError(f"particles = {particles}: at least 2 are needed")
        if proposal not in PROPOSALS:
            raise ConfigurationError(
                f"proposal {proposal!r} is unknown, known are {', '.join(PROPOSALS)}"
            )
        if not 0.0 <= threshold <= 1.0:
            raise ConfigurationError(f"threshold = {threshold}: must be from 0 to 1")
        self.backend = backends.chosen(backend)
        self.particles = particles
        self.proposal = proposal
        self._blind = proposal == "bootstrap"
        self._threshold = threshold * particles
        self._step: Callable[..., bool] = (
            backends.compiled(*STEP) if self.backend == "numba" else step_numpy
        )
        n, p = len(mean), len(model.channels)
        self._bits = normal_table.RandomBits(generator, n * particles)
        self._table = normal_table.table()
        self._cloud = np.empty((2, particles))
        self._cloud[0], self._cloud[1] = -math.log(particles), 1.0 / particles
        self._x = np.asarray(mean, dtype=float)[:, None] + self._scatter(square_root(covariance))
        self._new = np.empty((n, particles))
        self._u = np.zeros(len(model.inputs))
        self._pending = False
        self._width = 3 * p + n + 2
        self._row = np.zeros(self._width)
        self._row[3 * p : -2] = mean
        self._consistency = ConsistencyMonitor(expected=expected)
        self.diverged = False
        self._tracked: tuple[Flags, Array | Views, Array | Views] | None = None
        self.adopt(model)

    def __deepcopy__(self, memo: dict[int, Any]) -> ParticleFilter:
        """An independent copy; model, matrices and tables are read-only and shared."""
        twin = copy(self)
        for name in ("_bits", "_cloud", "_x", "_new", "_u", "_row", "_consistency"):
            setattr(twin, name, deepcopy(getattr(self, name), memo))
        return twin

    def adopt(self, model: FilterModel) -> None:
        """Continue with another model of the same states and channels."""
        self._model = model
        self._linear = None if self._blind else model.linear
        self._patterns: dict[tuple[bytes, bytes], _Pattern] = {}
        self._tracked = None
        self._heed(np.zeros((len(self._x), len(self._x))))

    def _heed(self, noise: Array) -> None:
        """Use this covariance of process noise for the next step."""
        self._noise = noise
        self._root = square_root(noise) if self._blind else noise
        self._pattern = self._patterned(np.zeros(len(self._model.channels)))

    @property
    def mean(self) -> Array:
        """Estimated states, shape (n,), without the scatter of the last draw."""
        mean: Array = self._row[3 * len(self._model.channels) : -2]
        return mean

    @property
    def covariance(self) -> Array:
        """Covariance of the cloud, shape (n, n)."""
        weights = self._cloud[1]
        apart = self._x - (self._x @ weights)[:, None]
        covariance: Array = (apart * weights) @ apart.T
        return covariance

    @property
    def cloud(self) -> tuple[Array, Array]:
        """Particles, shape (n, N), and their weights, shape (N,)."""
        return self._x.copy(), self._cloud[1].copy()

    def predict(self, u: Array) -> None:
        """Move every particle by one period under the inputs ``u``, shape (m,)."""
        if self._pending:
            # The last scan had no measurement: its process noise has not been drawn yet.
            self.update(np.full(len(self._model.channels), np.nan))
        self._u[:] = u
        self._pending = True
        noise = self._model.process_noise(self._u)
        if noise is not self._noise:
            self._heed(noise)
        if self._linear is None:
            self._x = self._model.transition(self._x, self._u)
        if self._blind:
            self._x = self._x + self._scatter(self._root)

    def update(self, y: Array, *, frozen: bool = False) -> Innovation:
        """Compare with a measurement, shape (p,), NaN = not measured, and correct by it."""
        bits = self._bits.next()
        if frozen:
            compared = self._correct(y, self._cloud.copy(), bits)
            told = Innovation(compared, len(y), self._pattern.measured, self.diverged)
            y = np.where(self._model.driving, y, np.nan)
        row = self._correct(y, self._cloud, bits)
        self._row = row
        self._x, self._new = self._new, self._x
        self._pending = False
        if frozen:
            told.mean[:] = self.mean  # without the correction
            return told
        measured = self._pattern.measured
        self.diverged = self._consistency.step(row.item(-2), measured)
        return Innovation(row, len(y), measured, self.diverged)

    def track(
        self,
        observe: Callable[..., tuple[int, int, float]],
        rows: Array,
        read: Callable[[Array], tuple[Array, Array, Array]],
        model: tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]],
        frozen: bool,
        begun: bool,
        told: tuple[Array, Counts, Flags, Counts],
    ) -> tuple[int, int]:
        """``predict`` and ``update`` with rows of readings, in one compiled call.

        For the optimal proposal with numba on a ``DrivenModel``, whose ``observe``, ``read`` (input
        and measurements of one row) and ``model`` these are. Particles that have ``begun`` with the
        first row stand where they are in it: there is no ``predict``.

        Returns
        -------
        How many scans were taken, at least one, and what ended it; see ``track_loops``.
        """
        bits = self._bits.ahead(1 if begun else len(rows))
        given, motion, heat = model
        done, end, monitor = 0, 0, self._consistency
        while not done:
            if self._tracked is None:
                u, y, held = read(rows[0])
                if begun:
                    y[:] = held[:] = math.nan
                self._tracked = self._prepared(begun, u, y, held)
            done, end, monitor.level = observe(
                rows,
                given,
                (self._x, self._cloud),
                self._tracked,
                bits,
                self._table,
                self._threshold,
                motion,
                heat,
                (monitor.level, *monitor.limits, self.diverged),
                frozen,
                begun,
                self._row,
                told,
            )
            if begun or not done:
                self._tracked = None
        self._bits.used(done)
        self.diverged = bool(told[2][done - 1])
        return done, end

    def _prepared(
        self, begun: bool, u: Array, y: Array, held: Array
    ) -> tuple[Flags, Array | Views, Array | Views]:
        """Input of ``track_loops`` for scans with the missing channels of this one."""
        noise = self._noise if begun else self._model.process_noise(u)
        if noise is not self._noise:
            self._heed(noise)
        self._pattern = self._patterned(y)
        return ~np.isnan(u), self._pattern.matrices, self._patterned(held).matrices

    def _correct(self, y: Array, cloud: Array, bits: tuple[float, normal_table.Indices]) -> Array:
        """Correct a cloud; the row of an ``Innovation``."""
        row = np.empty(self._width)
        while not self._step(
            self._x,
            cloud,
            self._new,
            y,
            self._u,
            self._pattern.matrices,
            *bits,
            self._table,
            self._threshold,
            row,
        ):
            self._pattern = self._patterned(y)
        return row

    def _scatter(self, root: Array) -> Array:
        """Gaussian numbers of zero mean and covariance root root', shape (n, N)."""
        shape = (root.shape[1], self.particles)
        normal = normal_table.normal_numbers(self._bits.next()[1], self._table, shape)
        scattered: Array = root @ normal
        return scattered

    def _patterned(self, y: Array) -> _Pattern:
        measured = np.isfinite(y)
        key = (self._noise.tobytes(), measured.tobytes())
        found = self._patterns.get(key)
        if found is None:
            if len(self._patterns) >= PATTERNS:
                self._patterns.clear()
            found = self._patterns[key] = self._make_pattern(measured)
        return found

    def _make_pattern(self, measured: npt.NDArray[np.bool_]) -> _Pattern:
        model, n, p = self._model, len(self._x), len(measured)
        Q = np.zeros((n, n)) if self._blind else self._noise
        factor, whitening, gain = np.zeros((p, p)), np.zeros((p, p)), np.zeros((n, p))
        if measured.any():
            block = np.ix_(measured, measured)
            H, R = model.H[measured], model.R[block]
            lower = np.linalg.cholesky(H @ Q @ H.T + R)
            inverse = np.linalg.inv(lower)
            factor[block], whitening[block] = lower, inverse
            gain[:, measured] = Q @ H.T @ inverse.T @ inverse
        keep = np.eye(n) - gain @ model.H
        spread = square_root(keep @ Q @ keep.T + gain @ model.R @ gain.T)
        T, B = self._linear or (np.eye(n), np.zeros((n, len(self._u))))
        drive = model.H @ B + model.D
        flat = pack(T, B, model.H, drive, model.h, whitening, factor, gain, spread)
        compiled = self.backend == "numba"
        matrices = flat if compiled else unpack(flat, n, p, len(self._u))
        return _Pattern(matrices, int(measured.sum()))
