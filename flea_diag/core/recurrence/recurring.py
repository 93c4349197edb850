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

"""Which fault comes and goes: short deviations of the relations that one fault explains each time.

A *burst* is a run of windows in which a relation is far out. Bursts alone are no proof: a fault
that stays shows in bursts as well, where what it acts by (a current, a direction) comes and goes.
So for every fault that explains them it is asked, window by window, how much of it is there,

    a = F'e / F'F,

with ``F`` what the fault at its size adds to the relations and ``e`` what they show. Where ``F'F``
is small nothing is known. Where it is large, ``a`` near 1 is *present* and near 0 *absent*; a fault
comes and goes when it has been absent, between times at which it was present, in windows in which
it would have shown, and when nothing that stays explains the same windows as well: a fault, another
unit, or both. The windows about the ends of a burst hold some of it, more or less: of what stays
they say nothing. Of what comes and goes each window may hold another part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.fault_evidence import other_unit
from flea_diag.core.evidence.fault_signatures import SizePrior
from flea_diag.core.evidence.marginal_ratio import Sums, marginal_ratio, posterior
from flea_diag.core.evidence.white_stream import exact_share
from flea_diag.core.flag_runs import flag_runs
from flea_diag.core.frozen import Frozen
from flea_diag.core.recurrence.parts import EXPLAINED, in_one_form, in_parts, of_a_part
from flea_diag.core.recurrence.stream_part import StreamPart

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Places = npt.NDArray[np.int64]

FAR, NEAR = 8.0, 4.0
"""Standard deviations that the farthest window of a burst is out, and up to which one is quiet: of
normal noise in a stand's relations one window in a thousand is farther out."""
SHOWS = 6.0
"""Standard deviations that a fault must add to a window for its presence to be known there."""
ABSENT = 0.35
"""Share of a fault up to which it is absent."""
LEAST_TIMES = 4
"""Times that a fault must have come, and gone: after one of 300 healthy switches to another unit a
relation was far out three times."""
ONE_WAY = 0.95
"""Share of windows of either state in one direction from which on direction explains it."""
USUAL = 0.95
"""Share of windows without a fault that jump by less than what counts as usual."""
APART_NATS = 50.0
"""By how much a fault that comes and goes must be ahead of all that stays: where no model is exact,
parts in single windows fit better than what stays, by 33 in a real jam."""


@dataclass(frozen=True, eq=False)
class RecurringFault(Frozen):
    """A fault that explains the bursts.

    Attributes
    ----------
    model
        Its number.
    nats
        Evidence of the bursts over nothing.
    size, sigma
        With standard errors, shape (sizes,).
    whole
        Whether bursts last long enough for that to be its size, and not a part of it.
    states
        1 where it is present, -1 where it is absent, 0 where nothing is known, shape (n,).
    """

    model: int
    nats: float
    size: Array
    sigma: Array
    whole: bool
    states: Places

    @property
    def comings(self) -> Places:
        """Windows with which it came, each after one in which it was absent or the first."""
        return _comings(self.states)


def bursts(far: Array, least: float = FAR) -> list[slice]:
    """Runs of windows that are not quiet and hold one that is at least so far out."""
    runs = flag_runs(far > NEAR)
    farthest = np.maximum.reduceat(np.append(far, 0.0), runs.ravel())[::2]
    return [slice(first, behind) for first, behind in runs[farthest > least].tolist()]


def recurring(
    part: StreamPart, prior: SizePrior, usable: Flags, reading: Sequence[int], moments: int = 1
) -> list[RecurringFault]:
    """Faults that come and go, the most likely first; none where that is not shown.

    Parameters
    ----------
    prior
        Of the sizes of every model.
    usable
        Models of faults that can come and go, shape (models,).
    reading
        Of every model the reading that it is an error of; -1: of none.
    moments
        Into which each window is parted: what no model gives exactly is alike in all of them.
    """
    runs = bursts(part.far)
    if len(runs) < LEAST_TIMES:
        return []
    inner = [slice(run.start + 1, run.stop - 1) for run in runs if run.stop - run.start > 3]
    if 2 * len(inner) >= len(runs):
        found = _weighed(part, runs, inner, prior, usable, reading, moments, whole=True)
        if found:
            return found
    peaks = (run.start + int(part.far[run].argmax()) for run in runs if run.stop - run.start <= 3)
    told_by = [*inner, *(slice(peak, peak + 1) for peak in peaks)]
    return _weighed(part, runs, told_by, of_a_part(prior), usable, reading, moments, whole=False)


def _weighed(
    part: StreamPart, runs: Sequence[slice], told_by: Sequence[slice], prior: SizePrior,
    usable: Flags, reading: Sequence[int], moments: int, whole: bool,
) -> list[RecurringFault]:  # fmt: skip
    """Faults that come and go by these windows of the bursts ``runs``.

    ``whole``: they hold all of a fault.
    """
    loud = _marked(told_by, len(part.errors))
    sums = _sums(part, loud)
    found = posterior(sums, prior)
    parts = None if whole else in_parts(part, loud, prior)
    size = found.size if parts is None else parts.largest
    left, shown = _left(part, loud, size)
    fits = usable & (left < (1.0 - EXPLAINED) * shown)
    which = np.flatnonzero(fits)
    states = _states(part, which, size[which])
    often = _turns(states) >= LEAST_TIMES
    shows = [
        (k, own)
        for k, own in zip(which[often].tolist(), states[often], strict=True)
        if not _is_one_way(part, own) and _jumps(part, own, reading[k])
    ]
    if not shows:  # its evidence is asked last: most do not come and go, and what stays takes all
        return []
    if parts is None:
        parts = in_parts(part, loud, of_a_part(prior))
    form = in_one_form(marginal_ratio(sums, prior, reaching=True), parts, [k for k, _ in shows])
    quiet = ~_marked(runs, len(loud))
    everything = _stays(part, quiet | loud, prior)
    kept = []
    for k, own in shows:
        rest = loud.copy()
        rest[loud] = ~form.fits[:, k]
        # What stays and is no part of the bursts may be there beside what comes and goes as well.
        gone = _alike(part, loud, k, size) if moments > 1 else np.zeros_like(usable)
        beside = max(_stays(part, quiet | rest, prior).most(gone), 0.0)
        if form.told[k] > max(everything.most(gone) - beside, 0.0) + APART_NATS * moments:
            nats = float(form.nats[k])
            kept.append(RecurringFault(k, nats, size[k], found.sigma[k], whole, own))
    return sorted(kept, key=lambda each: -each.nats)


def _marked(runs: Sequence[slice], count: int) -> Flags:
    """Which of so many windows are in one of the runs."""
    marked = np.zeros(count, dtype=bool)
    for run in runs:
        marked[run] = True
    return marked


def _alike(part: StreamPart, loud: Flags, model: int, size: Array) -> Flags:
    """Models of faults that act like this one in the bursts, itself among them, (models,)."""
    added = (part.faults[:, :, model] * size[model]).sum(axis=-1)
    left, shown = _left(replace(part, errors=added), loud, size)
    return np.asarray(left < (1.0 - EXPLAINED) * shown)


class _Stays(NamedTuple):
    """Evidence of what stays: of faults alone, of another unit, and beside it of each fault."""

    alone: float
    unit: float
    beside: Array

    def most(self, gone: Flags) -> float:
        """Of what fits best: a fault, another unit, or both.

        ``gone``, (models,): a fault that was seen to be absent stays beside no unit that makes up
        for it whenever it is, which has the freedom to explain any fault that comes and goes.
        Windows are too long to say so: a speed that reads wrong by a share stays, and is ahead of
        itself by 140.
        """
        return max(self.alone, self.unit + float(self.beside[~gone].max(initial=0.0)))


def _stays(part: StreamPart, which: Flags, prior: SizePrior) -> _Stays:
    """Of what stays in these windows."""
    alone, both = (_sums(part, which, of_unit) for of_unit in (False, True))
    faults, with_unit = (marginal_ratio(s, prior, reaching=True) for s in (alone, both))
    return _Stays(float(faults.max()), other_unit(both.own, 1), with_unit)


def _sums(part: StreamPart, which: Flags, of_unit: bool = False) -> Sums:
    """Sums over these windows, what no model gives exactly counting as noise.

    ``of_unit``: with what another unit may differ by.
    """
    errors = part.errors[which]
    exact, own = exact_share(errors), errors[..., None]
    if of_unit:
        own = np.concatenate((own, part.units[which]), axis=-1)
    return Sums.of(own * exact, part.faults[which] * exact[..., None])


def _left(part: StreamPart, loud: Flags, size: Array) -> tuple[Array, Array]:
    """Squares that each model leaves of these windows at the best share of each, and all of them.

    Both of shape (models,).
    """
    effect = np.einsum("nrks,ks->nkr", part.faults[loud], size)
    errors = part.errors[loud]
    along = np.einsum("nkr,nr->nk", effect, errors)
    strength = np.maximum(np.square(effect).sum(axis=-1), 1e-300)
    shown = np.square(errors).sum(axis=1)
    explained = np.where(along > 0.0, np.square(along) / strength, 0.0)
    return (shown[:, None] - explained).sum(axis=0), np.full(len(size), shown.sum())


def _states(part: StreamPart, models: Places, sizes: Array) -> Places:
    """Where faults of these sizes are there, and where not, window by window: (models, n)."""
    effect = (part.faults[:, :, models] * sizes).sum(axis=-1)
    # Where the relation that shows most of a fault has no value, the others may miss it.
    most = np.abs(effect).sum(axis=0).argmax(axis=0)
    read = np.take_along_axis(effect, most[None, None], axis=1)[:, 0] != 0.0
    strength = np.sqrt(np.square(effect).sum(axis=1))
    along = (effect * part.errors[..., None]).sum(axis=1) / np.maximum(strength, 1e-300)
    explained = EXPLAINED * np.square(part.errors).sum(axis=1)
    shows = read & (strength >= SHOWS)
    states = np.where(shows & (np.abs(along) < ABSENT * strength), -1, 0)
    runs = bursts(part.far, SHOWS)
    inside = np.flatnonzero(_marked(runs, len(states)))
    lengths = np.array([run.stop - run.start for run in runs], dtype=int)
    begins, told = np.cumsum(lengths) - lengths, along[inside]
    peak = np.maximum.reduceat(told, begins)
    at_peak = told == np.repeat(peak, lengths, axis=0)
    least = np.maximum.reduceat(np.where(at_peak, explained[inside, None], 0.0), begins)
    there = np.repeat((peak > SHOWS) & (np.square(peak) > least), lengths, axis=0)
    states[inside] = np.where(there, 1, states[inside])
    return np.ascontiguousarray(states.T)


def _turns(states: Places) -> Places:
    """How often each came and how often it went, the smaller, (models,), of states (models, n)."""
    every, told = np.arange(states.shape[1]), states != 0
    last = np.maximum.accumulate(np.where(told, every, -1), axis=1)
    before = np.column_stack((np.full(len(states), -1), last[:, :-1]))
    was = np.where(before >= 0, np.take_along_axis(states, np.maximum(before, 0), axis=1), 0)
    turned = told & (was != states)
    came, went = (np.count_nonzero(turned & (states == way), axis=1) for way in (1, -1))
    return np.asarray(np.minimum(came, went))


def _comings(states: Places) -> Places:
    """See ``RecurringFault.comings``."""
    told = np.flatnonzero(states)
    turned = np.diff(states[told], prepend=-1) > 0
    return np.asarray(told[turned & (states[told] > 0)])


def _is_one_way(part: StreamPart, states: Places) -> bool:
    """Whether it came and went with a direction of motion."""
    return any(_parts(way, states) for way in part.ways.T)


def _parts(way: Array, states: Places) -> bool:
    """Whether a fault is there in one direction and not in the other: then it may well stay."""
    here, gone = way[(states > 0) & (way != 0)], way[(states < 0) & (way != 0)]
    if not len(here) or not len(gone):
        return False
    forth = float((here > 0).mean())
    back = float((gone < 0).mean())
    return min(forth, back) >= ONE_WAY or max(forth, back) <= 1.0 - ONE_WAY


def _jumps(part: StreamPart, states: Places, reading: int) -> bool:
    """Whether a reading has jumped when its error came, by more than it does otherwise."""
    if reading < 0:
        return True
    jumps = part.jumps[:, reading]
    near = np.zeros(len(jumps), dtype=bool)
    for run in bursts(part.far, SHOWS):
        near[max(run.start - 1, 0) : run.stop + 1] = True
    if near.all():
        return True
    usual = float(np.quantile(jumps[~near], USUAL))
    came = [float(jumps[max(k - 1, 0) : k + 2].max()) for k in _comings(states)]
    return float(np.median(came)) > usual
