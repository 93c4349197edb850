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

"""Learn the law of healthy recordings from all of them.

Noise, spread and sound recordings depend on each other: each is learned in turn with the others as
they are. Coefficients are in units of their prior standard deviation inside, so that newtons and
ohms weigh alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.fault_columns import FaultColumns
from flea_diag.core.run_law.known_variance import KnownVariance
from flea_diag.core.run_law.law_columns import NEGLECTED, LawColumns
from flea_diag.core.run_law.law_noise import (
    TOGETHER,
    LawNoise,
    WhiteRun,
    calibrated,
    learned_noise,
)
from flea_diag.core.run_law.law_score import law_score
from flea_diag.core.run_law.restricted_likelihood import Spread
from flea_diag.core.run_law.run_defects import Candidates, UnsoundRun, sizes_beside
from flea_diag.core.run_law.run_law import FeignedSize, LawTerm, RelationNoise, RunLaw
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import WINDOW_S, RunWindows
from flea_diag.core.run_law.time_constant import moving_variance, time_constant_s
from flea_diag.core.run_law.unsound_runs import RunsJudged, sound_runs
from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

NEGLECTED_SHARE = 0.3
"""Prior of what a neglected term adds, in standard deviations of the noise of a window."""
MEAN_TOLERANCES = 3.0
"""Prior of what a parameter of this unit differs by from the calibrated one."""
ROUNDS = 3
"""Each round learns the noise anew; offline, two made no difference on the FLEA's recordings."""
ONSETS = (0.25, 0.5, 0.75)
"""Shares of a recording at which something is taken to begin in it."""
STEP = "law of healthy recordings"
Flags = npt.NDArray[np.bool_]
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law, the recordings that are unsound, and the columns that it kept.

    ``noisy``: relations that were left out of one recording, for their noise; ``sound``: the
    recordings that it was learned from, without them; ``contradicting``: recordings that are
    unlike the others, but too many for it to be clear which are the healthy ones; ``of_motion``:
    those that are so in most units, which were kept.
    """

    law: RunLaw
    unsound: tuple[UnsoundRun, ...]
    noisy: tuple[UnsoundRun, ...]
    columns: LawColumns
    sound: tuple[RunWindows, ...]
    contradicting: tuple[UnsoundRun, ...] = ()
    of_motion: tuple[UnsoundRun, ...] = ()


def learn_law(
    runs: Sequence[RunWindows],
    columns: LawColumns,
    faults: FaultColumns,
    sharing: Sequence[tuple[int, int]],
    progress: Progress = lambda done, of, step: None,
) -> LawFit:
    """The law of these recordings, of one unit or of several.

    Parameters
    ----------
    sharing
        Pairs of relations that read a sensor in common, the later one first.
    """
    learning = _Learning(runs, columns, faults, sharing)
    for number in range(ROUNDS):
        progress(number + 1, ROUNDS + 1, STEP)
        learning.judge()
        learning.learn_noise()
    progress(ROUNDS + 1, ROUNDS + 1, STEP)
    judged = learning.judge()
    which = np.flatnonzero(judged.sound).tolist()
    sound = tuple(learning.runs[k] for k in which)
    return LawFit(
        _law(learning, judged),
        judged.unsound,
        tuple(learning.noisy),
        learning.columns,
        sound,
        judged.contradicting,
        judged.of_motion,
    )


class _Learning:
    """Noise, levels and sound recordings as they are so far; coefficients in prior deviations."""

    def __init__(
        self, runs: Sequence[RunWindows], columns: LawColumns, faults: FaultColumns,
        sharing: Sequence[tuple[int, int]],
    ) -> None:  # fmt: skip
        runs = _noisy_alone(runs)
        self.runs, self.faults, self._sharing = list(runs), faults, sharing
        self.columns = columns.some(acting(runs, columns))
        self.scale = _scale(runs, self.columns)
        self.groups = np.unique([run.unit for run in runs], return_inverse=True)[1]
        self.noise = learned_noise([r.values for r in runs], (), ())
        self.noisy: list[UnsoundRun] = []
        self._judged: RunsJudged | None = None
        self.sums: RunSums

    def judge(self) -> RunsJudged:
        """Judge all recordings by the noise as it is; leave out relations that are too noisy."""
        found = self._candidates()
        self.sums, self._judged = found.own, sound_runs(found)
        for noisy in self._judged.noisy:
            values = self.runs[noisy.place].values.copy()
            values[:, self.columns.relations.index(noisy.what)] = np.nan
            self.runs[noisy.place] = replace(self.runs[noisy.place], values=values)
        self.noisy += self._judged.noisy
        return self._judged

    def of(self, k: int) -> Array:
        """Columns of a recording, scaled."""
        return self.columns.of(self.runs[k]) * self.scale

    def learn_noise(self) -> None:
        """Noise of what sound recordings leave beside their coefficients."""
        assert self._judged is not None
        which = np.flatnonzero(self._judged.sound).tolist()
        laws = {unit: self._judged.levels.of_unit(unit) for unit in np.unique(self.groups).tolist()}
        own, freedom = [], 0.0
        for k in which:
            law = laws[int(self.groups[k])]
            apart, kept = law.posterior(self.sums[k])
            own.append(law.mean + apart)
            freedom += float(np.einsum("ij,ji->", kept, self.sums.gram[k]))
        left = [self.runs[k].values - self.of(k) @ c for k, c in zip(which, own, strict=True)]
        motion = [self.runs[k].motion for k in which]
        signals = [self.runs[k].signals for k in which]
        noise = learned_noise(left, self._sharing, signals)
        white = noise.whitened_all([self.runs[k] for k in which], [self.of(k) for k in which])
        e = [w.left(c) for w, c in zip(white, own, strict=True)]
        share = np.array([w.known.sum(axis=0) for w in white], dtype=float).sum(axis=0)
        unknowns = freedom * share / max(share.sum(), 1.0)
        self.noise = calibrated(noise, e, [w.known for w in white], motion, unknowns)

    def _candidates(self) -> Candidates:
        """Sums of recordings, far-out windows counting less, and what each leaves."""
        sums, squares, counts = [], [], []
        for start in range(0, len(self.runs), TOGETHER):
            some = range(start, min(start + TOGETHER, len(self.runs)))
            both = [np.concatenate((self.of(k), self.faults.of(self.runs[k])), -1) for k in some]
            for white in self.noise.whitened_all([self.runs[k] for k in some], both):
                own, fit = self._bounded(white)
                sums.append(RunSums.of(own))
                squares.append(np.square(own.left(fit)).sum(axis=0))
                counts.append(white.known.sum(axis=0))
        values = np.array(counts, dtype=float)
        one = np.ones(len(self.columns))
        guessed = np.array([column.kind == NEGLECTED for column in self.columns.columns])
        return Candidates(
            RunSums.stacked(sums), np.array(squares) / np.maximum(values, 1.0), values,
            self.columns.columns, self.faults.columns, self.columns.relations, self.scale,
            VariancePrior(one, guessed), one, MEAN_TOLERANCES**2 * one, self.groups,
            self._least_sizes(),
        )  # fmt: skip

    def _least_sizes(self) -> Array:
        """Sizes of columns and faults that move a relation as much as healthy units differ in it.

        Shape (columns and faults,); columns in prior deviations.
        """
        stated = np.array([c.kind != NEGLECTED for c in self.columns.columns], dtype=float)
        healthy, moved = [], []
        for k, run in enumerate(self.runs):
            known = np.isfinite(run.values)[..., None]
            own = np.square(self.of(k)) * known
            healthy.append((own * stated).sum(axis=-1).mean(axis=0))
            moved.append((np.square(self.faults.of(run)) * known).mean(axis=0))
        share = np.sqrt(
            np.mean(moved, axis=0) / np.maximum(np.mean(healthy, axis=0), 1e-300)[:, None]
        )
        return np.concatenate((stated, 1.0 / np.maximum(share.max(axis=0), 1e-300)))

    def _bounded(self, white: WhiteRun) -> tuple[WhiteRun, Array]:
        """The recording with far-out windows counting less, and the coefficients beside which."""
        count, fit = len(self.columns), np.zeros(white.rows.shape[-1] - 1)
        prior, own = np.eye(count) / MEAN_TOLERANCES**2, white
        for _ in range(2):
            rough = RunSums.of(own).first(count)
            fit[:count] = np.linalg.solve(rough.gram + prior, rough.cross)
            own = white.bounded(fit)
        return own, fit


def _noisy_alone(runs: Sequence[RunWindows]) -> list[RunWindows]:
    """The recordings without relations that never change: of such a reading nothing is known."""
    still = _rough_sigma(runs) == 0.0
    if not still.any():
        return list(runs)
    return [replace(run, values=np.where(still, np.nan, run.values)) for run in runs]


def acting(runs: Sequence[RunWindows], columns: LawColumns) -> list[int]:
    """Columns that move a residual which some recording has."""
    acts = np.zeros(len(columns), dtype=bool)
    for run in runs:
        known = np.isfinite(run.values)[..., None]
        acts |= (np.abs(columns.of(run)) * known).max(axis=(0, 1), initial=0.0) > 0.0
    return np.flatnonzero(acts).tolist()


def _scale(runs: Sequence[RunWindows], columns: LawColumns) -> Array:
    """Prior standard deviation of each column: its tolerance, or a share of the noise."""
    sigma = _rough_sigma(runs)
    squares = np.mean([np.square(columns.of(run)).mean(axis=0) for run in runs], axis=0)
    reach = (np.sqrt(squares) / np.where(sigma > 0.0, sigma, np.inf)[:, None]).max(axis=0)
    return np.array([
        NEGLECTED_SHARE / r if c.kind == NEGLECTED else c.tolerance
        for c, r in zip(columns.columns, reach, strict=True)
    ])  # fmt: skip


def _rough_sigma(runs: Sequence[RunWindows]) -> Array:
    """Scatter of the residuals from window to window, shape (relations,); 0 where there is none."""
    steps = np.concatenate([np.diff(run.values, axis=0) for run in runs])
    sigmas = []
    for column in steps.T:
        known = np.abs(column[np.isfinite(column)])
        sigmas.append(1.4826 * float(np.median(known)) / np.sqrt(2.0) if len(known) else 0.0)
    return np.array(sigmas)


def _law(of: _Learning, judged: RunsJudged) -> RunLaw:
    """The law in SI units."""
    levels, which = judged.levels, np.flatnonzero(judged.sound).tolist()
    chosen = [of.runs[k] for k in which]
    columns = [of.of(k) for k in which]
    laws = [levels.of_unit(int(of.groups[k]), number) for number, k in enumerate(which)]
    score = law_score(chosen, columns, of.noise, of.sums[np.array(which)], laws)
    own = [Spread(law.mean, levels.variance, law.covariance) for law in laws]
    tau_s, variance = time_constant_s(chosen, columns, of.noise, own), levels.variance
    if tau_s < np.median([len(run) for run in chosen]) * WINDOW_S:
        moving = moving_variance(chosen, columns, of.noise, own, levels.prior)
        variance = np.maximum(variance, moving)
    wide = np.maximum(variance, levels.known.wide())
    units = levels.units
    one = levels.of_unit(units[0])
    mean, covariance = (one.mean, one.covariance) if len(units) == 1 else levels.design()
    deviations = np.sqrt([variance, levels.unit_variance, wide]) * of.scale
    terms = tuple(
        LawTerm(c.name, c.kind, float(m * z), float(run), float(unit), c.relation, float(wide))
        for c, m, z, run, unit, wide in zip(
            of.columns.columns, mean, of.scale, *deviations, strict=True
        )
    )
    scaled = covariance * of.scale[:, None] * of.scale
    lower = tuple(tuple(map(float, row[: k + 1])) for k, row in enumerate(scaled))
    moved = [replace(law, variance=variance) for law in laws]
    return RunLaw(
        terms, _noise_rows(of.columns, of.noise), lower, len(which), len(units), tau_s, score,
        _feigned(of.faults, judged.feigned, begun_sizes(of, which, moved)),
    )  # fmt: skip


def begun_sizes(of: _Learning, which: Sequence[int], laws: Sequence[Spread]) -> Array:
    """Variance of each fault's size that begins within these recordings, shape (faults,).

    Recordings drift and step while they are healthy, as after a start in the cold.
    """
    count, sizes, errors = len(of.columns), [], []
    for k, law in zip(which, laws, strict=True):
        own, run = of.of(k), of.runs[k]
        near = np.append(law.mean + law.posterior(of.sums[k])[0], np.zeros(len(of.faults)))
        onsets = [int(share * len(run)) for share in ONSETS]
        both = [np.concatenate((own, of.faults.of(run, onset)), axis=-1) for onset in onsets]
        for white in of.noise.whitened_all([run] * len(both), both):
            every = RunSums.of(white.bounded(near))
            found = sizes_beside(every.beside(np.append(law.mean, near[count:])), law, count)
            told = np.isfinite(found.size[count:])
            sizes.append(np.where(told, found.size[count:], 0.0))
            errors.append(np.where(told, found.variance[count:], np.inf))
    square = np.square(sizes) / errors
    scale = np.median(errors, axis=0)
    prior = VariancePrior(np.where(np.isfinite(scale), scale, 1.0), np.ones(len(scale), dtype=bool))
    return KnownVariance(square, 1.0 / np.array(errors), prior).likely()


def _feigned(faults: FaultColumns, found: Array, begun: Array) -> tuple[FeignedSize, ...]:
    rows = np.column_stack((found[0], np.sqrt(found[1:]).T, np.sqrt(begun))).tolist()
    return tuple(
        FeignedSize(column.fault, column.size, *row)
        for column, row in zip(faults.columns, rows, strict=True)
    )


def _noise_rows(columns: LawColumns, noise: LawNoise) -> tuple[RelationNoise, ...]:
    return tuple(
        RelationNoise(
            name,
            float(np.sqrt(noise.white[k])),
            float(np.sqrt(noise.coloured[k])),
            float(noise.phi[k]),
            _any(noise.shared[k, :k]),
            tuple(map(float, noise.motion[k])),
            _any(noise.by_slope[k, :k]),
        )
        for k, name in enumerate(columns.relations)
    )


def _any(values: Array) -> tuple[float, ...]:
    """The same as numbers; empty where all are 0."""
    return tuple(map(float, values)) if values.any() else ()
