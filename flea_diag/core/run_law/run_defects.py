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

"""What may be wrong with one recording among others.

It is held against a mixture: as the others, or with one coefficient, one fault of the catalogue
from before its start, or all those of the unit far off; the component with the largest Bayes factor
is its name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.fault_columns import FaultColumn
from flea_diag.core.run_law.known_variance import KnownVariance
from flea_diag.core.run_law.law_columns import UNIT, LawColumn
from flea_diag.core.run_law.restricted_likelihood import Spread
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.unit_levels import UnitLevels
from flea_diag.core.run_law.variance_prior import VariancePrior

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FAULT, NOISE, MANY = "fault", "noise", "many"
BROAD = 10.0
"""Standard deviation of the size of a defect, in those by which its size is known."""
SHARE = 0.05
"""Of recordings that are unsound, a priori: 2 of the first 62 of the FLEA were."""
LEAST_GAIN = 1e-9
"""Share of its information that a direction must keep beside all that recordings differ by."""
WITHIN_UNITS = 0.5
"""Share of what healthy units differ by below which no recording is unsound, however well the
difference is known."""
CHANGED = 3.0
"""Factor of a variance by which rooms, supplies and motions change healthy noise."""


@dataclass(frozen=True)
class UnsoundRun:
    """One recording that is not as the others.

    Attributes
    ----------
    what
        Column, fault or relation; of ``MANY`` the one that is farthest off.
    kind
        ``UNIT``, ``FREE`` or ``NEGLECTED`` of a column, ``FAULT``, ``NOISE``, or ``MANY`` columns
        of the unit at once.
    size, usual
        What it differs by, and one standard deviation of the others, in SI units; of noise its
        factor and 1.
    nats
        Log of the posterior odds.
    shown
        Everything that would be a defect by itself: what is best differs by the noise of each.
    """

    place: int
    what: str
    kind: str
    size: float
    usual: float
    nats: float
    shown: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Candidates:
    """Recordings to be judged: sums, mean square of what each relation leaves, and its values.

    ``sums`` hold the columns and then ``faults``; ``misfit`` and ``counts`` have shape
    (recordings, relations). ``scale`` makes SI units of coefficients. ``differing``, shape (columns
    and faults,), are the sizes by which healthy units differ in what they move.
    """

    sums: RunSums
    misfit: Array
    counts: Array
    columns: Sequence[LawColumn]
    faults: Sequence[FaultColumn]
    relations: tuple[str, ...]
    scale: Array
    prior: VariancePrior
    unit_prior: Array
    mean_prior: Array
    groups: npt.NDArray[np.intp]
    differing: Array

    @cached_property
    def own(self) -> RunSums:
        """Sums of the columns of the law."""
        return self.sums.first(len(self.columns))

    def fit(self, sound: Flags) -> UnitLevels:
        """The levels of those that are sound."""
        which = np.flatnonzero(sound)
        return UnitLevels.of(
            self.own[which], self.prior, self.unit_prior, self.mean_prior, self.groups[which]
        )


def defects_of(
    of: Candidates, levels: UnitLevels, sound: Flags
) -> tuple[list[UnsoundRun], UsualSizes]:
    """The most likely defect of each recording, with its odds; sound ones judged by the others."""
    members = np.flatnonzero(sound).tolist()
    place = {k: number for number, k in enumerate(members)}
    laws = [
        levels.of_unit(int(of.groups[k]), place.get(k, -1), wide=True) for k in range(len(of.sums))
    ]
    sizes = [_sizes(of, k, law) for k, law in enumerate(laws)]
    usual = _usual_sizes(sizes, sound)
    odds = [
        _defect(of, k, laws[k], size, usual.size, usual.known.wide(place.get(k, -1)))
        for k, size in enumerate(sizes)
    ]
    return odds, usual


class Sizes(NamedTuple):
    """Size of every column and fault by itself, its variance, and the share of noise alone in it.

    NaN where a direction cannot be told from what recordings differ by.
    """

    size: Array
    variance: Array
    noise: Array


class UsualSizes(NamedTuple):
    """Sizes of all directions that sound recordings show."""

    size: Array
    known: KnownVariance


def _sizes(of: Candidates, k: int, law: Spread) -> Sizes:
    """Of one recording."""
    every = of.sums[k].beside(np.concatenate((law.mean, np.zeros(len(of.faults)))))
    return sizes_beside(every, law, len(of.columns))


def sizes_beside(every: RunSums, law: Spread, count: int) -> Sizes:
    """All that recordings differ by, the first so many columns, integrated out."""
    own, mixed = every.gram[:count, :count], every.gram[:, :count]
    kept = np.linalg.inv(np.linalg.inv(np.diag(law.variance) + law.covariance) + own)
    explained = mixed @ kept
    alone = np.diag(every.gram)
    gain = alone - np.einsum("ij,ij->i", explained, mixed)
    gain = np.where(gain > LEAST_GAIN * alone, gain, np.nan)
    pull = every.cross - explained @ every.cross[:count]
    return Sizes(pull / gain, 1.0 / gain, 1.0 / np.where(alone > 0.0, alone, np.inf))


def _usual_sizes(sizes: Sequence[Sizes], sound: Flags) -> UsualSizes:
    """What sound recordings feign of each direction beyond what the noise of one explains.

    A signal that carries the noise of its own relation feigns a share of itself (errors in
    variables): in healthy recordings, too. How much is a guess of the size of that noise.
    """
    found = np.array([each.size for each, good in zip(sizes, sound, strict=True) if good])
    error = np.array([each.variance for each, good in zip(sizes, sound, strict=True) if good])
    told = np.isfinite(found)
    blank = ~told.any(axis=0)
    found[:, blank], error[:, blank] = 0.0, np.inf
    centre = np.nanmedian(found, axis=0)
    square = np.where(told, np.square(found - centre) / error, 0.0)
    noise = np.median([each.noise for each, good in zip(sizes, sound, strict=True) if good], axis=0)
    prior = VariancePrior(np.where(noise > 0.0, noise, 1.0), np.ones(len(noise), dtype=bool))
    return UsualSizes(centre, KnownVariance(square, np.where(told, 1.0 / error, 0.0), prior))


def _defect(
    of: Candidates, k: int, law: Spread, sizes: Sizes, centre: Array, feigned: Array
) -> UnsoundRun:
    found = list(_directions(of, k, sizes, centre, feigned))
    if not found:
        return UnsoundRun(k, "", UNIT, 0.0, 0.0, -np.inf)
    best = max(found, key=lambda each: each.nats)
    many = _unit(of, k, law)
    found.append(replace(best, kind=MANY, nats=many))
    best = max(best, found[-1], key=lambda each: each.nats)
    prior = np.log(SHARE / len(found))
    shown = tuple(each.what for each in found[:-1] if each.nats + prior > 0.0)
    odds = float(np.logaddexp.reduce([each.nats for each in found]) + prior)
    return replace(best, nats=odds, shown=shown)


def _directions(
    of: Candidates, k: int, sizes: Sizes, centre: Array, feigned: Array
) -> Iterator[UnsoundRun]:
    """Each column and each fault by itself."""
    entries = [
        (c.name, c.kind, (-np.inf, np.inf), z) for c, z in zip(of.columns, of.scale, strict=True)
    ]
    entries += [(f.name, FAULT, (f.low, f.high), 1.0) for f in of.faults]
    is_fault = np.arange(len(entries)) >= len(of.columns)
    apart = sizes.size - np.where(is_fault, centre, 0.0)
    variance = sizes.variance + np.where(is_fault, feigned, 0.0)
    nats = 0.5 * np.square(apart) / variance - np.log(BROAD)
    for j, (name, kind, (low, high), scale) in enumerate(entries):
        is_large = abs(apart[j]) > WITHIN_UNITS * of.differing[j]
        if np.isfinite(nats[j]) and is_large and low <= apart[j] <= high:
            error = float(np.sqrt(variance[j]) * scale)
            yield UnsoundRun(k, name, kind, float(apart[j] * scale), error, float(nats[j]))


def _unit(of: Candidates, k: int, law: Spread) -> float:
    """Log Bayes factor of all that units differ by, at once."""
    is_unit = np.array([column.kind == UNIT for column in of.columns])
    other = replace(law, variance=law.variance + of.mean_prior * is_unit)
    return float(other.log_density(of.own[k]) - law.log_density(of.own[k]))


def noises_of(of: Candidates, k: int, sound: Flags) -> Iterator[UnsoundRun]:
    """Relations of a recording that are far noisier than in the sound ones, by the logarithm."""
    for j, name in enumerate(of.relations):
        logs = np.log(np.maximum(of.misfit[sound & (of.counts[:, j] > 0.0), j], 1e-12))
        if of.counts[k, j] < 1.0 or len(logs) <= 2:
            continue
        centre = float(np.median(logs))
        spread = max(1.4826 * float(np.median(np.abs(logs - centre))), np.log(CHANGED) / 3.0)
        apart = float(np.log(max(of.misfit[k, j], 1e-12))) - centre
        nats = 0.5 * (apart / spread) ** 2 - np.log(BROAD * len(of.relations) / SHARE)
        if apart > 0.0 and nats > 0.0:
            factor = float(np.exp(0.5 * apart))
            yield UnsoundRun(k, name, NOISE, factor, 1.0, float(nats), (name,))
