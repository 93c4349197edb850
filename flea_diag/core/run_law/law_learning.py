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
from flea_diag.core.run_law.law_columns import NEGLECTED, UNIT, LawColumns
from flea_diag.core.run_law.law_noise import LawNoise, WhiteRun, calibrated, learned_noise
from flea_diag.core.run_law.law_score import law_score
from flea_diag.core.run_law.restricted_likelihood import PRIOR_RUNS, Spread, fitted
from flea_diag.core.run_law.run_law import FeignedSize, LawTerm, RelationNoise, RunLaw
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import RunWindows
from flea_diag.core.run_law.time_constant import time_constant_s
from flea_diag.core.run_law.unsound_runs import Candidates, UnsoundRun, sound_runs

Array = npt.NDArray[np.float64]

NEGLECTED_SHARE = 0.3
"""Prior of what a neglected term adds, in standard deviations of the noise of a window."""
MEAN_TOLERANCES = 3.0
"""Prior of what a parameter of this unit differs by from the calibrated one."""
ROUNDS = 3
LEAST_UNITS = 5
"""Units from which on what units differ by is learned."""

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law, the recordings that are unsound, and the columns that it kept.

    ``noisy``: relations that were left out of one recording, for their noise; ``sound``: the
    recordings that it was learned from, without them.
    """

    law: RunLaw
    unsound: tuple[UnsoundRun, ...]
    noisy: tuple[UnsoundRun, ...]
    columns: LawColumns
    sound: tuple[RunWindows, ...]


@dataclass(frozen=True, eq=False)
class _Prior:
    """Variances of what recordings and their mean differ by, in scaled units; the scale."""

    scale: Array
    run: Array
    mean: Array


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
    sigma = _rough_sigma(runs)
    columns = columns.some(_acting(runs, columns))
    prior = _prior(runs, columns, sigma)
    groups = np.unique([run.unit for run in runs], return_inverse=True)[1]
    noise = learned_noise([run.values for run in runs], [run.turning for run in runs], ())
    sound = np.ones(len(runs), dtype=bool)
    kept: list[WhiteRun] = []
    noisy: tuple[UnsoundRun, ...] = ()
    for number in range(ROUNDS + 1):
        progress(number, ROUNDS + 1, "law of healthy recordings")
        kept = [
            noise.whitened(
                run, np.concatenate((columns.of(run) * prior.scale, faults.of(run)), axis=-1)
            )
            for run in runs
        ]
        found = _candidates(kept, columns, faults, prior, groups)
        sums = found.own
        judged = sound_runs(found)
        sound, spread = judged.sound, judged.spread
        if number < ROUNDS:
            noisy += judged.noisy
            runs = _without(runs, judged.noisy, columns.relations)
            noise = _noise(runs, columns, prior, spread, sums, sound, sharing)
    return LawFit(
        replace(
            _law(runs, columns, prior, noise, spread, sums, sound, groups),
            feigned=_feigned(faults, judged.feigned),
        ),
        judged.unsound,
        noisy,
        columns,
        tuple(runs[k] for k in np.flatnonzero(sound).tolist()),
    )


def _without(
    runs: Sequence[RunWindows], noisy: Sequence[UnsoundRun], relations: tuple[str, ...]
) -> list[RunWindows]:
    """The recordings without these relations of some of them."""
    made = list(runs)
    for found in noisy:
        values = made[found.place].values.copy()
        values[:, relations.index(found.what)] = np.nan
        made[found.place] = replace(made[found.place], values=values)
    return made


def _rough_sigma(runs: Sequence[RunWindows]) -> Array:
    """Scatter of the residuals from window to window, shape (relations,); 1 where there is none."""
    steps = np.concatenate([np.diff(run.values, axis=0) for run in runs])
    sigmas = []
    for column in steps.T:
        known = np.abs(column[np.isfinite(column)])
        sigma = 1.4826 * float(np.median(known)) / np.sqrt(2.0) if len(known) else 0.0
        sigmas.append(sigma if sigma > 0.0 else 1.0)
    return np.array(sigmas)


def _acting(runs: Sequence[RunWindows], columns: LawColumns) -> list[int]:
    """Columns that move a residual which some recording has."""
    acts = np.zeros(len(columns), dtype=bool)
    for run in runs:
        known = np.isfinite(run.values)[..., None]
        acts |= (np.abs(columns.of(run)) * known).max(axis=(0, 1)) > 0.0
    return np.flatnonzero(acts).tolist()


def _prior(runs: Sequence[RunWindows], columns: LawColumns, sigma: Array) -> _Prior:
    squares = np.mean([np.square(columns.of(run)).mean(axis=0) for run in runs], axis=0)
    reach = (np.sqrt(squares) / sigma[:, None]).max(axis=0)
    scale = np.array([
        NEGLECTED_SHARE / r if c.kind == NEGLECTED else c.tolerance
        for c, r in zip(columns.columns, reach, strict=True)
    ])  # fmt: skip
    return _Prior(scale, np.ones(len(columns)), np.full(len(columns), MEAN_TOLERANCES**2))


def _candidates(
    white: Sequence[WhiteRun], columns: LawColumns, faults: FaultColumns, prior: _Prior,
    groups: Array,
) -> Candidates:  # fmt: skip
    """Sums of recordings, far-out windows counting less, and what each leaves beside its own."""
    sums, squares = [], []
    for run in white:
        own = run
        for _ in range(2):
            rough = RunSums.of(own).first(len(columns))
            mean = np.linalg.solve(rough.gram + np.diag(1.0 / prior.mean), rough.cross)
            fit = np.concatenate((mean, np.zeros(len(faults))))
            own = run.bounded(fit)
        sums.append(RunSums.of(own))
        squares.append(np.square(own.left(fit)).sum(axis=0))
    counts = np.array([run.known.sum(axis=0) for run in white], dtype=float)
    misfit = np.array(squares) / np.maximum(counts, 1.0)
    return Candidates(
        RunSums.stacked(sums), misfit, counts, columns.columns, faults.columns, columns.relations,
        prior.scale, prior.run, prior.mean, groups,
    )  # fmt: skip


def _noise(
    runs: Sequence[RunWindows], columns: LawColumns, prior: _Prior, spread: Spread, sums: RunSums,
    sound: npt.NDArray[np.bool_], sharing: Sequence[tuple[int, int]],
) -> LawNoise:  # fmt: skip
    """Noise of what sound recordings leave beside their coefficients."""
    apart, kept = spread.posterior(sums)
    which = np.flatnonzero(sound).tolist()
    left = [
        runs[k].values - columns.of(runs[k]) @ (prior.scale * (spread.mean + apart[k]))
        for k in which
    ]
    turning = [runs[k].turning for k in which]
    noise = learned_noise(left, turning, sharing)
    white = [noise.whitened(runs[k], columns.of(runs[k]) * prior.scale) for k in which]
    e = [w.left(spread.mean + apart[k]) for w, k in zip(white, which, strict=True)]
    freedom = float(np.einsum("kij,kji->k", kept, sums.gram)[which].sum())
    share = np.array([w.known.sum(axis=0) for w in white], dtype=float).sum(axis=0)
    unknowns = freedom * share / max(share.sum(), 1.0)
    return calibrated(noise, e, [w.known for w in white], turning, unknowns)


def _law(
    runs: Sequence[RunWindows], columns: LawColumns, prior: _Prior, noise: LawNoise,
    spread: Spread, sums: RunSums, sound: npt.NDArray[np.bool_], groups: Array,
) -> RunLaw:  # fmt: skip
    which = np.flatnonzero(sound)
    count = len(which)
    # A variance that is known from few recordings: the predictive distribution is wider.
    freedom = PRIOR_RUNS + count - 1.0
    wider = freedom / max(freedom - 2.0, 1.0)
    spread = Spread(spread.mean, spread.variance * wider, spread.covariance)
    units, unit_variance, spread = _units(sums[which], groups[which], spread, prior, columns)
    terms = tuple(
        LawTerm(c.name, c.kind, float(m * z), float(np.sqrt(v) * z), float(np.sqrt(u) * z),
                c.relation)
        for c, m, v, u, z in zip(columns.columns, spread.mean, spread.variance, unit_variance,
                                 prior.scale, strict=True)
    )  # fmt: skip
    covariance = spread.covariance * prior.scale[:, None] * prior.scale
    lower = tuple(tuple(map(float, row[: k + 1])) for k, row in enumerate(covariance))
    chosen = [runs[k] for k in which.tolist()]
    scaled = [columns.of(run) * prior.scale for run in chosen]
    score = law_score(chosen, scaled, noise, sums[which], spread, prior.mean)
    tau_s = time_constant_s(chosen, scaled, noise, spread)
    return RunLaw(terms, _noise_rows(columns, noise), lower, count, units, tau_s, score)


def _feigned(faults: FaultColumns, found: tuple[Array, Array]) -> tuple[FeignedSize, ...]:
    return tuple(
        FeignedSize(column.fault, column.size, float(mean), float(np.sqrt(variance)))
        for column, mean, variance in zip(faults.columns, *found, strict=True)
    )


def _units(
    sums: RunSums, groups: Array, spread: Spread, prior: _Prior, columns: LawColumns
) -> tuple[int, Array, Spread]:
    """Units that were learned from, variances between units, and the spread about their mean.

    With fewer than ``LEAST_UNITS`` the variances are those of the tolerances.
    """
    stated = np.array([c.kind == UNIT for c in columns.columns], dtype=float)
    members = [np.flatnonzero(groups == unit) for unit in np.unique(groups)]
    if len(members) < LEAST_UNITS:
        return 0, stated, spread
    freed = sums.freed(spread.variance)
    of_units = RunSums.stacked(
        RunSums(*(getattr(freed, name)[w].sum(axis=0) for name in RunSums.__dataclass_fields__))
        for w in members
    )
    least = np.maximum(stated, 1e-8)
    between = fitted(of_units, least, prior.mean)
    mean = Spread(between.mean, spread.variance, between.covariance)
    return len(members), between.variance * stated, mean


def _noise_rows(columns: LawColumns, noise: LawNoise) -> tuple[RelationNoise, ...]:
    return tuple(
        RelationNoise(
            name,
            float(np.sqrt(noise.white[k])),
            float(np.sqrt(noise.coloured[k])),
            float(noise.phi[k]),
            float(noise.turning[k]),
            tuple(map(float, noise.shared[k, :k])) if noise.shared[k, :k].any() else (),
        )
        for k, name in enumerate(columns.relations)
    )
