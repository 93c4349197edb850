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

"""How fast what a recording differs by moves within it.

c is a stationary process with the variance S between recordings and the correlation exp(-t / tau).
The likelihood of the recordings in pieces, each of which says something of c at its time, chooses
tau of a row; the longest row is told from a constant by no recording.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.law_noise import LawNoise
from flea_diag.core.run_law.restricted_likelihood import Spread, run_variance
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import WINDOW_S, RunWindows
from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]

TAUS_S = (30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0)
"""Half a minute to hours: faster is noise, slower is another recording."""
PIECE_WINDOWS = 50
"""10 s, over which what a recording differs by is taken as constant."""
WITHIN_NATS = 2.0
"""Below the best: the shortest of these time constants is taken, which hides least."""
MOST_RUNS = 100
"""Recordings that are looked at, evenly over all."""


def time_constant_s(
    runs: Sequence[RunWindows],
    columns: Sequence[Array],
    noise: LawNoise,
    spreads: Sequence[Spread],
) -> float:
    """Time constant that explains the recordings, the shortest that they do not exclude.

    ``spreads`` are those of the unit of each recording.
    """
    step = -(-len(runs) // MOST_RUNS)
    chosen = list(zip(runs, columns, spreads, strict=True))[::step]
    pieces = [_pieces(run, x, noise, spread.mean) for run, x, spread in chosen]
    variance = spreads[0].variance
    nats = np.array([sum(_log_density(p, variance, tau) for p in pieces) for tau in TAUS_S])
    return float(next(t for t, n in zip(TAUS_S, nats, strict=True) if n > nats.max() - WITHIN_NATS))


def moving_variance(
    runs: Sequence[RunWindows], columns: Sequence[Array], noise: LawNoise,
    spreads: Sequence[Spread], prior: VariancePrior,
) -> Array:  # fmt: skip
    """Variance of a process that moves within each recording, shape (columns,).

    Of pieces about the mean of their unit: a whole recording is a mean over what has moved in it.
    """
    every = [
        piece
        for run, x, spread in zip(runs, columns, spreads, strict=True)
        for piece in _pieces(run, x, noise, spread.mean)
    ]
    units = np.zeros(len(every), dtype=np.intp)
    known = np.diag(spreads[0].covariance)
    return run_variance(RunSums.stacked(every), prior, known, units)


def _pieces(run: RunWindows, x: Array, noise: LawNoise, mean: Array) -> list[RunSums]:
    """Sums of each piece of a recording, whitened in one go."""
    white = noise.whitened(run, x).bounded(mean)
    made = []
    for start in range(0, len(run), PIECE_WINDOWS):
        rows = white.rows[start : start + PIECE_WINDOWS].reshape(-1, x.shape[-1] + 1)
        products = rows.T @ rows
        zero = np.zeros(())
        made.append(
            RunSums(products[1:, 1:], products[1:, 0], products[0, 0], zero, zero).beside(mean)
        )
    return made


def _log_density(pieces: Sequence[RunSums], variance: Array, tau_s: float) -> float:
    """Log density of the pieces of one recording in a stationary process."""
    kept = np.exp(-PIECE_WINDOWS * WINDOW_S / tau_s)
    stationary = np.diag(variance)
    mean, covariance, nats = np.zeros(len(variance)), stationary.copy(), 0.0
    identity = np.eye(len(variance))
    for piece in pieces:
        # An update in the form of information: nothing is said of what no signal moves.
        inner = identity + piece.gram @ covariance
        off = piece.cross - piece.gram @ mean
        solved = np.linalg.solve(inner, off)
        square = float(piece.square - 2.0 * piece.cross @ mean + mean @ piece.gram @ mean)
        nats -= 0.5 * (square - float(off @ covariance @ solved) + np.linalg.slogdet(inner)[1])
        mean = mean + covariance @ solved
        covariance = covariance @ np.linalg.inv(inner)
        mean, covariance = kept * mean, kept**2 * covariance + (1.0 - kept**2) * stationary
    return nats
