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

"""Recordings that the others show not to be healthy, found together.

One at a time two of one kind mask each other: each widens what recordings may differ by for the
other. So the law is learned from the half that lies nearest to the middle, and whatever lies
within that law is added, until nothing changes (BACON; Billor, Hadi and Velleman 2000). What may be
wrong with one is told by ``run_defects``. A relation that is far noisier than in the others is left
out of that recording alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.run_defects import Candidates, UnsoundRun, defects_of, noises_of
from flea_diag.core.run_law.run_sums import posterior_covariance
from flea_diag.core.run_law.unit_levels import UnitLevels

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

MOST_UNSOUND = 0.25
"""Share of the recordings beyond which it is not clear which are the healthy ones."""
LEAST_UNITS, MOST_OF_UNITS = 3, 2.0 / 3.0
"""So many units, and that share of all, must have a recording with a defect for it to be none."""
ROUNDS = 12
"""Beyond, two sets follow on each other: the last one is taken."""


class RunsJudged(NamedTuple):
    """Which recordings are sound, their levels, and the others with what is wrong with them.

    ``noisy`` are relations of sound recordings whose noise is far off: a channel of it is bad.
    ``feigned`` are centre and variance of each fault's size in sound ones, and the variance that a
    claim is held against, shape (3, faults).
    ``contradicting`` are those that would be unsound, were they not too many, ``of_motion`` those
    of which most units have one.
    """

    sound: Flags
    levels: UnitLevels
    unsound: tuple[UnsoundRun, ...]
    noisy: tuple[UnsoundRun, ...]
    feigned: Array
    contradicting: tuple[UnsoundRun, ...] = ()
    of_motion: tuple[UnsoundRun, ...] = ()


def sound_runs(of: Candidates) -> RunsJudged:
    """Judge all recordings together.

    Defects come to recordings one by one. What one recording of most units shows is of its motion,
    and of what the description lacks there: those are kept.
    """
    kept = np.zeros(len(of.sums), dtype=bool)
    of_motion: tuple[UnsoundRun, ...] = ()
    while True:
        judged = _sound_beside(of, kept)
        unlike = judged.unsound + judged.contradicting
        shared = _of_most_units(of, unlike) & ~kept
        if not shared.any():
            return judged._replace(of_motion=of_motion)
        of_motion += tuple(found for found in unlike if shared[found.place])
        kept = kept | shared


def _of_most_units(of: Candidates, unsound: Sequence[UnsoundRun]) -> Flags:
    """Recordings whose defect a recording of most units has."""
    shared = np.zeros(len(of.sums), dtype=bool)
    least = max(LEAST_UNITS, MOST_OF_UNITS * len(np.unique(of.groups)))
    for what in {w for found in unsound for w in found.shown}:
        places = [found.place for found in unsound if what in found.shown]
        shared[places] |= len(np.unique(of.groups[places])) >= least
    return shared


def _sound_beside(of: Candidates, kept: Flags) -> RunsJudged:
    """The same; ``kept``: recordings that are sound whatever the others show.

    Where the half in the middle leaves out more than a quarter, it was a kind of its own, one load
    say, among kinds that are all healthy: then whatever contradicts all of them is left out. If
    that is as much, or nothing, it is not clear which are the healthy ones, and all are kept.
    """
    half = _settled(of, _nearest_half(of), kept)
    most = MOST_UNSOUND * len(of.sums)
    if len(half.unsound) <= most:
        return half
    every = np.ones(len(of.sums), dtype=bool)
    judged = _settled(of, every, kept)
    if 0 < len(judged.unsound) <= most:
        return judged
    return _taken(of, every)._replace(contradicting=judged.unsound or half.unsound)


def _settled(of: Candidates, sound: Flags, kept: Flags) -> RunsJudged:
    """Sound recordings, from these on, until nothing changes."""
    sound = sound | kept
    for _ in range(ROUNDS):
        odds, _ = defects_of(of, of.fit(sound), sound)
        now = np.array([found.nats <= 0.0 for found in odds])
        if 2 * now.sum() < len(now):
            now = _least_odd(odds)
        now |= kept
        if (now == sound).all():
            break
        sound = now
    return _taken(of, sound)


def _taken(of: Candidates, sound: Flags) -> RunsJudged:
    """All recordings, judged by these."""
    levels = of.fit(sound)
    odds, usual = defects_of(of, levels, sound)
    unsound = tuple(found for found, good in zip(odds, sound, strict=True) if not good)
    loud = tuple(n for k in np.flatnonzero(sound).tolist() for n in noises_of(of, k, sound))
    shared = _of_most_units(of, loud)
    noisy = tuple(found for found in loud if not shared[found.place])
    first = len(of.columns)
    rows = usual.size, usual.known.likely(), usual.known.wide()
    feigned = np.array(rows)[:, first:]
    return RunsJudged(sound, levels, unsound, noisy, feigned)


def _nearest_half(of: Candidates) -> Flags:
    """The half of the recordings nearest to the middle: by medians, which a quarter cannot move.

    Too few for a half to say anything are all taken.
    """
    count = len(of.sums)
    if count < 4:
        return np.ones(count, dtype=bool)
    kept, _ = posterior_covariance(of.own.gram, of.mean_prior)
    own = np.matmul(kept, of.own.cross[..., None])[..., 0]
    middle = np.array([np.median(own[of.groups == unit], axis=0) for unit in of.groups])
    error = np.einsum("kii->ki", kept)
    spread = np.square(1.4826 * np.median(np.abs(own - middle), axis=0))
    apart = np.square(own - middle) / (error + np.maximum(spread, 0.25 * of.prior.scale))
    distance = apart.max(axis=1, initial=0.0)
    return np.asarray(distance <= np.median(distance))


def _least_odd(odds: Sequence[UnsoundRun]) -> Flags:
    """The half that is least odd: which of them are the healthy ones is not clear."""
    nats = np.array([found.nats for found in odds])
    return np.asarray(nats <= np.median(nats))
