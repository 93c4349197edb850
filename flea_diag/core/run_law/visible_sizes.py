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

"""What a calibration can see: the size from which on a fault shows in the motion of a recording.

The information on the sizes of a fault, with all that recordings differ by integrated out, is

    G' = G - G F (1 + F G F)^-1 F G

less what healthy recordings feign (F, by size). Evidence is what a fault explains less what is
spent on sizes that it might have had (S, what they may be a priori),

    E = size^2 w'G'w / 2 - (log |1 + S G S| - log |1 + F G F|) / 2

along w, so half of the recordings reach a limit where E does. A fault from before the recording is
held against the variances between recordings; one with an onset mostly against the noise, for the
time before it has shown what the recording is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.run_law.fault_columns import FaultColumns
from flea_diag.core.run_law.law_columns import LawColumns
from flea_diag.core.run_law.run_law import RunLaw, VisibleSize
from flea_diag.core.run_law.run_sums import RunSums
from flea_diag.core.run_law.run_windows import WINDOW_S, RunWindows

Array = npt.NDArray[np.float64]

FOLLOWED_S = 10.0
"""Time after its onset in which a fault is to be detected."""
FOLLOWED = round(FOLLOWED_S / WINDOW_S)
BEFORE = 1.0 / 3.0
"""Share of a recording before the onset."""
ALIKE = 1e-3
"""Share of its information that a fault must keep beside another one to be told from it."""
MOST_RUNS = 60
"""Recordings whose motion is looked at, evenly over all."""
ONSETS_PER_HOUR = 9000.0
"""One begins every 0.4 s, about the smoothing of the readings."""
WIDE = 10.0
"""Least standard deviation of a size without a bound, in sizes that half of the recordings show."""

Loudness = Callable[[Array], Array]
"""Factor of the noise in windows of these signals, shape (windows, relations) of (..., signals)."""


def limit_nats(rate_per_hour: float, models: int) -> float:
    """Lower bound of the limit that keeps a rate of false alarms, over onsets and models.

    Under no fault a likelihood ratio exceeds exp(x) with a probability of at most exp(-x).
    """
    return math.log(ONSETS_PER_HOUR * max(models, 1) / rate_per_hour)


@dataclass(frozen=True, eq=False)
class SizeErrors:
    """Information on sizes in each recording, shape (recordings, faults, faults).

    ``beside`` are standard errors beside the most similar other fault that a fault is told from,
    shape (recordings, faults); ``alike`` the faults that it is told from in no recording.
    """

    onset_grams: Array
    before_grams: Array
    beside: Array
    alike: tuple[tuple[str, ...], ...]

    @property
    def onset(self) -> Array:
        """Standard errors of what has an onset, shape (recordings, faults); infinite: unseen."""
        return _errors(np.einsum("nkk->nk", self.onset_grams))

    @property
    def before(self) -> Array:
        """The same of what was there before the recording."""
        return _errors(np.einsum("nkk->nk", self.before_grams))


def visible_sizes(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, runs: Sequence[RunWindows],
    limit: float, drop_nats: float, loud: Loudness | None = None,
) -> tuple[VisibleSize, ...]:  # fmt: skip
    """Sizes of all faults that half of these recordings show.

    Parameters
    ----------
    limit, drop_nats
        What a fault must exceed no fault by, and another one, nats.
    loud
        Of the noise beyond that of the law.
    """
    errors = size_errors(law, columns, faults, runs, loud)
    feigned = np.array([(row.begun_sigma, row.claim_sigma or row.sigma) for row in law.feigned])
    begun, always = feigned.T if len(feigned) else np.zeros((2, len(faults)))
    onsets, befores = (
        _shown(grams, faults, feigns, limit)
        for grams, feigns in ((errors.onset_grams, begun), (errors.before_grams, always))
    )
    told = np.median(np.hypot(errors.beside, begun), axis=0) * math.sqrt(2.0 * drop_nats)
    found = []
    for k, column in enumerate(faults.columns):
        onset, before = float(onsets[k]), float(befores[k])
        largest = max(map(column.reach, column.signs), default=0.0)
        found.append(
            VisibleSize(column.fault, column.size, column.unit, onset, before,
                        max(float(told[k]), onset), largest=largest, alike=errors.alike[k])
        )  # fmt: skip
    return tuple(found)


def _shown(grams: Array, faults: FaultColumns, feigned: Array, limit: float) -> Array:
    """Sizes, one at a time, that half of the recordings show, shape (faults,)."""
    guess = _half_shown(grams, faults, np.zeros(len(faults)), feigned, limit)
    return _half_shown(grams, faults, possible_sizes(faults, guess), feigned, limit)


def _half_shown(
    grams: Array, faults: FaultColumns, reach: Array, feigned: Array, limit: float
) -> Array:
    """The same by what sizes may be: of all recordings the median."""
    shown = np.full(len(faults), np.inf)
    for members in _by_fault(faults).values():
        block = grams[:, members][:, :, members]
        every = [size_along(block, reach[members], feigned[members], way, limit)
                 for way in np.eye(len(members))]  # fmt: skip
        shown[members] = np.median(every, axis=1)
    return shown


def possible_sizes(faults: FaultColumns, shown: Array) -> Array:
    """Standard deviations of what sizes may be a priori, shape (faults,).

    ``shown``: those that half of the recordings show, shape (faults,), for what has no bound.
    """
    span = np.array([column.high - column.low for column in faults.columns]) / math.sqrt(12.0)
    wide = np.where(np.isfinite(shown), WIDE * shown, 0.0)
    return np.where(np.isfinite(span), span, wide)


def size_along(information: Array, reach: Array, feigned: Array, way: Array, limit: float) -> Array:
    """Size along ``way``, shape (sizes,), at which the expected evidence of a fault is ``limit``.

    Parameters
    ----------
    information
        On the sizes of the fault, shape (..., sizes, sizes).
    reach, feigned
        Standard deviations of what they may be, and of what healthy recordings feign, (sizes,).

    Returns
    -------
    Shape (...); infinite where nothing shows it.
    """
    possible, healthy = (
        np.eye(len(way)) + scale[:, None] * information * scale for scale in (reach, feigned)
    )
    explained = (information * feigned) @ np.linalg.inv(healthy) @ (feigned[:, None] * information)
    along = way @ (information - explained) @ way
    spent = 0.5 * (np.linalg.slogdet(possible)[1] - np.linalg.slogdet(healthy)[1])
    nats = limit + np.maximum(spent, 0.0)
    return np.where(along > 0.0, np.sqrt(2.0 * nats / np.maximum(along, 1e-300)), np.inf)


def size_errors(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, runs: Sequence[RunWindows],
    loud: Loudness | None = None,
) -> SizeErrors:  # fmt: skip
    """What each recording tells of the sizes of all faults."""
    chosen = runs[:: -(-len(runs) // MOST_RUNS)]
    ends = [int(BEFORE * len(run)) for run in chosen]
    onset = np.array(
        [
            information(law, columns, faults, run.part(slice(0, end + FOLLOWED)), end, loud)
            for run, end in zip(chosen, ends, strict=True)
        ]
    )
    before = np.array([information(law, columns, faults, run, 0, loud) for run in chosen])
    beside, alike = _beside(onset, faults)
    return SizeErrors(onset, before, _errors(beside), alike)


def information(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, run: RunWindows, onset: int = 0,
    loud: Loudness | None = None,
) -> Array:  # fmt: skip
    """Information on sizes from a window on, what recordings differ by integrated out.

    Shape (faults, faults), in 1 over the units of both sizes.
    """
    spread = law.spread()
    total = np.diag(spread.variance) + spread.covariance
    scale = np.sqrt(np.diag(total))
    scale = np.where(scale > 0.0, scale, 1.0)
    own = columns.of(run) * scale
    white = law.law_noise.whitened(run, np.concatenate((own, faults.of(run, onset)), axis=-1))
    if loud is not None:
        white = replace(white, rows=white.rows / loud(run.signals)[..., None])
    sums, count = RunSums.of(white), len(scale)
    prior = np.linalg.inv(total / scale[:, None] / scale + 1e-12 * np.eye(count))
    mixed = sums.gram[count:, :count]
    kept = np.linalg.inv(prior + sums.gram[:count, :count])
    return np.asarray(sums.gram[count:, count:] - mixed @ kept @ mixed.T)


def _errors(information: Array) -> Array:
    return np.where(information > 0.0, 1.0 / np.sqrt(np.maximum(information, 1e-300)), np.inf)


def _beside(grams: Array, faults: FaultColumns) -> tuple[Array, tuple[tuple[str, ...], ...]]:
    """Information beside the most similar other fault, shape (recordings, faults)."""
    members = _by_fault(faults)
    own = np.einsum("nkk->nk", grams)
    least, alike = own.copy(), []
    for k, name in enumerate(column.fault for column in faults.columns):
        same = []
        for other, which in members.items():
            if other == name:
                continue
            left = own[:, k] - _explained(grams[:, which][:, :, which], grams[:, k][:, which])
            if (left <= ALIKE * own[:, k]).all():
                same.append(other)
            else:
                least[:, k] = np.minimum(least[:, k], np.maximum(left, 0.0))
        alike.append(tuple(same))
    return least, tuple(alike)


def _by_fault(faults: FaultColumns) -> dict[str, list[int]]:
    """Numbers of the columns of each fault."""
    names = [column.fault for column in faults.columns]
    return {name: [k for k, n in enumerate(names) if n == name] for name in names}


def _explained(block: Array, cross: Array) -> Array:
    """Information that these columns explain, for each recording; some may move nothing there."""
    solved = np.matmul(np.linalg.pinv(block, rcond=1e-10, hermitian=True), cross[..., None])
    return np.asarray((cross * solved[..., 0]).sum(axis=-1))
