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

"""What is left of a healthy recording beside what it differs by: noise of the relations.

Of each relation white and coloured noise in windows (``level_noise`` without a level); relations
that share a sensor have a part in common, which is taken off each of them by those before it.
It grows with the motion (``motion_noise``). What is far out in a window counts as if it
were ``BOUND`` standard deviations out, whatever hypothesis it is held against: a spike is no fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.level_noise import LevelNoise, level_noise
from flea_diag.core.run_law.motion_noise import ANY_MOTION, motion_variances, with_rest
from flea_diag.core.run_law.run_windows import RunWindows, side_slope
from flea_diag.core.run_law.whitening import GainSequence, WhiteSignals

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

BOUND = 3.0
"""Standard deviations beyond which a window counts less: of normal noise 0.3 % are."""
SHARED = 0.05
"""Correlation between two relations below which none is taken into account."""
LASTING = (10, 50)
"""Windows, 2 s and 10 s, in which faults are told: what is left in white adds up over them to no
more."""
TOGETHER = 50
"""Recordings that are whitened side by side: memory is bounded by them."""
LEAST_WINDOWS = 50
"""Fewer tell no correlation, and no factor."""
MOTION_WINDOWS = 200
"""Fewer tell nothing of the motion."""


@dataclass(frozen=True, eq=False)
class LawNoise:
    """Noise of relations in windows.

    Attributes
    ----------
    white, coloured, phi
        Variances, and the correlation of the coloured part from window to window, shape
        (relations,).
    shared
        What a relation has of those before it, shape (relations, relations), lower triangle.
    by_slope
        What it has of them beside that where ``side_slope`` is 1, same shape.
    motion
        Shares of the variance at rest and for one of each motion, shape (relations, motions).
    """

    white: Array
    coloured: Array
    phi: Array
    shared: Array
    by_slope: Array
    motion: Array

    def of_others(self, signals: Array) -> Array:
        """What relations have of those before them in windows with these signals.

        Signals have shape (..., relations, signals); shape (..., relations, relations).
        """
        if not self.by_slope.any():
            return self.shared
        return np.asarray(self.shared + side_slope(signals)[..., None] * self.by_slope)

    def loudness(self, motion: Array) -> Array:
        """Factor of the standard deviation in windows that move so, shape (..., relations)."""
        return np.asarray(np.sqrt(with_rest(motion) @ self.motion.T))

    @property
    def sigma(self) -> Array:
        """Standard deviation of one window in the usual motion, shape (relations,)."""
        return np.asarray(np.sqrt(self.white + self.coloured))

    @property
    def long_run(self) -> Array:
        """Standard deviation of the mean of many windows, times the root of their number."""
        return np.asarray(np.sqrt(self.white + self.coloured * (1 + self.phi) / (1 - self.phi)))

    def levels(self) -> LevelNoise:
        """The same as the noise of a filter, without a level."""
        zero = np.zeros_like(self.white)
        return LevelNoise(self.white, self.coloured, self.phi, zero, zero)

    def scaled(self, factor: Array) -> LawNoise:
        """The same with standard deviations that are this much larger, shape (relations,)."""
        square = np.square(factor)
        return replace(self, white=self.white * square, coloured=self.coloured * square)

    def unshared(self, rows: Array, known: Flags, signals: Array) -> Array:
        """Rows, shape (windows, relations, n), each less what it has of those before it.

        Only where both have a value; ``known`` has shape (windows, relations), ``signals`` are
        those of the windows.
        """
        if not (self.shared.any() or self.by_slope.any()):
            return rows
        both = known[:, :, None] & known[:, None, :]
        return np.asarray(rows - np.matmul(np.where(both, self.of_others(signals), 0.0), rows))

    def whitened(self, run: RunWindows, columns: Array) -> WhiteRun:
        """White residuals and columns of a recording; columns: (windows, relations, n)."""
        return self.whitened_all([run], [columns])[0]

    def whitened_all(self, runs: Sequence[RunWindows], columns: Sequence[Array]) -> list[WhiteRun]:
        """Whiten many recordings side by side: one filter serves a window of all."""
        made = []
        for start in range(0, len(runs), TOGETHER):
            some = slice(start, start + TOGETHER)
            made += self._together(runs[some], columns[some])
        return made

    def _together(self, runs: Sequence[RunWindows], columns: Sequence[Array]) -> list[WhiteRun]:
        longest = max(map(len, runs))
        count = len(self.white)
        known = np.zeros((longest, len(runs), count), dtype=bool)
        both = np.zeros((*known.shape, 1 + columns[0].shape[-1]))
        for k, (run, x) in enumerate(zip(runs, columns, strict=True)):
            known[: len(run), k] = np.isfinite(run.values)
            values = np.nan_to_num(run.values)[..., None]
            whole = np.concatenate((values, x), axis=-1)
            both[: len(run), k] = self.unshared(whole, known[: len(run), k], run.signals)
        gains, signals = GainSequence(self.levels()), WhiteSignals(both.shape[1:])
        scales = np.ones(known.shape)
        for number, row in enumerate(both):
            gain = gains.step(known[number])
            both[number] = signals.step(row, gain)
            scales[number] = np.where(known[number], gain.scale[..., 0], 1.0)
        return [
            self._of_one(run, both[: len(run), k], known[: len(run), k], scales[: len(run), k])
            for k, run in enumerate(runs)
        ]

    def _of_one(self, run: RunWindows, white: Array, known: Flags, scales: Array) -> WhiteRun:
        loud = self.loudness(run.motion)
        log_scale = np.log(np.where(known, scales / loud, 1.0)).sum()
        return WhiteRun(white / loud[..., None], known, float(log_scale))


@dataclass(frozen=True, eq=False)
class WhiteRun:
    """[y, X] of a recording in its noise, shape (windows, relations, 1 + columns).

    ``log_scale`` is the log density that the scales alone give, constants left out.
    """

    rows: Array
    known: Flags
    log_scale: float

    def bounded(self, coefficients: Array) -> WhiteRun:
        """The same with windows that are far out, beside these coefficients, counting less."""
        left = np.abs(self.left(coefficients))
        weight = np.sqrt(np.minimum(1.0, BOUND / np.maximum(left, BOUND)))
        return replace(self, rows=self.rows * weight[..., None])

    def left(self, coefficients: Array) -> Array:
        """White residuals beside these coefficients, shape (windows, relations)."""
        return left_beside(self.rows, coefficients)


def left_beside(rows: Array, coefficients: Array) -> Array:
    """What is left of [y, X], shape (..., 1 + columns), beside coefficients of X."""
    return np.asarray(rows[..., 0] - rows[..., 1:] @ coefficients)


def learned_noise(
    left: Sequence[Array], sharing: Sequence[tuple[int, int]], signals: Sequence[Array]
) -> LawNoise:
    """Noise of what recordings leave, each of shape (windows, relations), NaN where there is none.

    Parameters
    ----------
    sharing
        Pairs of relations, the later one first, that read a sensor in common.
    signals
        Of the windows of each recording, shape (windows, relations, signals).
    """
    spikes = 1.5 * BOUND * np.array([_robust_sigma(left, k) for k in range(left[0].shape[1])])
    cut = [np.clip(entry, -spikes, spikes) for entry in left]
    count = left[0].shape[1]
    noise = level_noise(cut, walks=False)
    none = np.zeros((count, count))
    motion = np.tile(ANY_MOTION, (count, 1))
    plain = LawNoise(noise.white, noise.coloured, noise.phi, none, none, motion)
    if not sharing:
        return plain
    with_shared = replace(plain, shared=_shared(np.concatenate(cut), sharing))
    with_shared = _sloped(with_shared, cut, signals, sharing)
    if not (with_shared.shared.any() or with_shared.by_slope.any()):
        return plain
    noise = level_noise(_apart(with_shared, cut, signals), walks=False)
    return replace(with_shared, white=noise.white, coloured=noise.coloured, phi=noise.phi)


def calibrated(
    noise: LawNoise, left: Sequence[Array], known: Sequence[Flags], motion: Sequence[Array],
    unknowns: Array,
) -> LawNoise:  # fmt: skip
    """The same noise by how it grows with the motion, so that what is left is as large as it says.

    That is in single windows, far-out ones counting less, or where they add up to more over
    one of ``LASTING`` windows, in these.

    Parameters
    ----------
    left
        White residuals of each recording in the same noise in every motion, (windows, relations).
    unknowns
        Coefficients that they have been freed of, for each relation.
    """
    e, k, m = np.concatenate(left), np.concatenate(known), np.concatenate(motion)
    parts = np.array([_of_motion(e[:, j], k[:, j], m) for j in range(e.shape[1])])
    usual = parts @ with_rest(m).mean(axis=0)
    sigma = np.sqrt(usual)
    noise = replace(noise.scaled(sigma), motion=parts / usual[:, None])
    pairs = zip(left, known, motion, strict=True)
    white = [
        np.where(k, np.clip(e / sigma / noise.loudness(m), -BOUND, BOUND), 0.0) for e, k, m in pairs
    ]
    counts, count = k.sum(axis=0), np.maximum(k.sum(axis=0) - unknowns, 1.0)
    square = np.square(np.concatenate(white)).sum(axis=0) / count / WITHIN
    square *= np.max([np.ones(e.shape[1]), *(_lasting(white, n) for n in LASTING)], axis=0)
    found = np.where(counts >= LEAST_WINDOWS, np.sqrt(np.maximum(square, 1e-12)), 1.0)
    return noise.scaled(found)


WITHIN = 0.9950
"""Mean square of a standard normal variable that is cut off at ``BOUND``."""


def _of_motion(e: Array, known: Flags, motion: Array) -> Array:
    """Variance of one relation at rest and for one of each motion, (1 + motions,)."""
    if known.sum() < MOTION_WINDOWS:
        return np.array(ANY_MOTION)
    return motion_variances(np.square(e[known]), motion[known], BOUND**2)


def _lasting(white: Sequence[Array], windows: int) -> Array:
    """Mean square of sums over so many windows, over that of windows that are independent.

    Less one standard error: so much may be chance.
    """
    parts = [e[: len(e) // windows * windows].reshape(-1, windows, e.shape[1]) for e in white]
    every = np.concatenate(parts)
    squares = np.square(every).sum(axis=(0, 1))
    ratio = np.square(every.sum(axis=1)).sum(axis=0) / np.maximum(squares, 1e-300)
    return np.asarray(ratio / (1.0 + np.sqrt(2.0 / max(len(every), 1))))


def _robust_sigma(left: Sequence[Array], column: int) -> float:
    """Standard deviation by the median of the magnitudes; infinite where it is 0 or not known."""
    values = np.concatenate([entry[:, column] for entry in left])
    values = np.abs(values[np.isfinite(values)])
    sigma = 1.4826 * float(np.median(values)) if len(values) else 0.0
    return sigma if sigma > 0.0 else np.inf


def _apart(noise: LawNoise, left: Sequence[Array], signals: Sequence[Array]) -> list[Array]:
    """What relations have of their own, NaN where there is none."""
    made = []
    for each, of in zip(left, signals, strict=True):
        known = np.isfinite(each)
        rows = noise.unshared(np.nan_to_num(each)[..., None], known, of)[..., 0]
        made.append(np.where(known, rows, np.nan))
    return made


def _shared(left: Array, sharing: Sequence[tuple[int, int]]) -> Array:
    """Regression of each relation on those before it with which it shares a sensor."""
    found = np.zeros((left.shape[1],) * 2)
    for row, earlier in _earlier(sharing):
        use = np.isfinite(left[:, [row, *earlier]]).all(axis=1)
        found[row, earlier] = _regression(left[use, row], left[use][:, earlier])
    return found


def _sloped(
    noise: LawNoise, left: Sequence[Array], signals: Sequence[Array],
    sharing: Sequence[tuple[int, int]],
) -> LawNoise:  # fmt: skip
    """The same noise with what relations share by ``side_slope``, where they do.

    At rest as well, where the current is small: those that have no value there have no part.
    """
    shared, by_slope = noise.shared.copy(), noise.by_slope.copy()
    y, own = np.concatenate(left), np.concatenate(_apart(noise, left, signals))
    x, slopes = np.nan_to_num(y), np.concatenate([side_slope(each) for each in signals])
    for row, earlier in _earlier(sharing):
        use = np.isfinite(y[:, row])
        plain = x[use][:, earlier]
        sloped = plain * slopes[use, row, None]
        strong = _regression(own[use, row], sloped) != 0.0
        if strong.any():
            acts = np.concatenate(((shared[row, earlier] != 0.0) | strong, strong))
            parts = _coefficients(y[use, row], np.concatenate((plain, sloped), axis=1), acts)
            shared[row, earlier], by_slope[row, earlier] = parts.reshape(2, -1)
    return replace(noise, shared=shared, by_slope=by_slope)


def _earlier(sharing: Sequence[tuple[int, int]]) -> Iterator[tuple[int, list[int]]]:
    """Each relation that shares a sensor with some before it, and these."""
    for row in sorted({later for later, _ in sharing}):
        yield row, sorted(e for later, e in sharing if later == row)


def _regression(y: Array, x: Array) -> Array:
    """Coefficients of those columns of x that y is correlated with, 0 of the others."""
    if len(y) < LEAST_WINDOWS:
        return np.zeros(x.shape[1])
    strong = [abs(_correlation(column, y)) > SHARED for column in x.T]
    return _coefficients(y, x, np.array(strong, dtype=bool))


def _coefficients(y: Array, x: Array, acts: Flags) -> Array:
    """Coefficients of those columns of x that act, 0 of the others."""
    found = np.zeros(x.shape[1])
    if acts.any():
        sizes = np.maximum(x[:, acts].std(axis=0), 1e-300)
        found[acts] = np.linalg.lstsq(x[:, acts] / sizes, y, rcond=None)[0] / sizes
    return found


def _correlation(x: Array, y: Array) -> float:
    spread = float(x.std() * y.std())
    return float(((x - x.mean()) * (y - y.mean())).mean()) / spread if spread > 0.0 else 0.0
