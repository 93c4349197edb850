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

The information on the size of a fault, with all that recordings differ by integrated out, gives the
standard error of that size; where a limit in nats decides, half of the recordings show

    size = sqrt(2 limit) (1 / information + what healthy recordings feign)^(1/2)

A fault from before the recording is held against the variances between recordings; one with an
onset mostly against the noise, for the time before it has shown what the recording is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
BEFORE = 1.0 / 3.0
"""Share of a recording before the onset."""
ALIKE = 1e-3
"""Share of its information that a fault must keep beside another one to be told from it."""
MOST_RUNS = 60
"""Recordings whose motion is looked at, evenly over all."""
ONSETS_PER_HOUR = 9000.0
"""One begins every 0.4 s, about the smoothing of the readings."""


def limit_nats(rate_per_hour: float, models: int) -> float:
    """Lower bound of the limit that keeps a rate of false alarms, over onsets and models.

    Under no fault a likelihood ratio exceeds exp(x) with a probability of at most exp(-x).
    """
    return math.log(ONSETS_PER_HOUR * max(models, 1) / rate_per_hour)


@dataclass(frozen=True, eq=False)
class SizeErrors:
    """Standard errors of sizes in each recording, shape (recordings, faults); infinite: unseen.

    ``beside`` are those beside the most similar other fault that it is told from, ``alike`` the
    faults that it is told from in no recording.
    """

    onset: Array
    before: Array
    beside: Array
    alike: tuple[tuple[str, ...], ...]


def visible_sizes(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, runs: Sequence[RunWindows],
    limit: float, drop_nats: float,
) -> tuple[VisibleSize, ...]:  # fmt: skip
    """Sizes of all faults that half of these recordings show.

    Parameters
    ----------
    limit, drop_nats
        What a fault must exceed no fault by, and another one, nats.
    """
    errors = size_errors(law, columns, faults, runs)
    feigned = np.array([(row.begun_sigma, row.claim_sigma or row.sigma) for row in law.feigned])
    begun, always = feigned.T if len(feigned) else np.zeros((2, 0))
    found = []
    for k, column in enumerate(faults.columns):
        sizes = [
            float(np.median(np.hypot(each[:, k], feigns[k])) * math.sqrt(2.0 * nats))
            for each, feigns, nats in (
                (errors.onset, begun, limit), (errors.before, always, limit),
                (errors.beside, begun, drop_nats),
            )
        ]  # fmt: skip
        onset, before, named = sizes
        largest = max(map(column.reach, column.signs), default=0.0)
        found.append(
            VisibleSize(column.fault, column.size, column.unit, onset, before, max(named, onset),
                        largest=largest, alike=errors.alike[k])
        )  # fmt: skip
    return tuple(found)


def size_errors(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, runs: Sequence[RunWindows]
) -> SizeErrors:
    """Standard errors of the sizes of all faults in each recording."""
    chosen = runs[:: -(-len(runs) // MOST_RUNS)]
    grams = [(_onset_gram(law, columns, faults, run), information(law, columns, faults, run))
             for run in chosen]  # fmt: skip
    onset, before = (np.array([np.diag(each[k]) for each in grams]) for k in (0, 1))
    beside, alike = _beside(np.array([each[0] for each in grams]), faults)
    return SizeErrors(_errors(onset), _errors(before), _errors(beside), alike)


def _onset_gram(law: RunLaw, columns: LawColumns, faults: FaultColumns, run: RunWindows) -> Array:
    onset = int(BEFORE * len(run))
    followed = run.part(slice(0, onset + round(FOLLOWED_S / WINDOW_S)))
    return information(law, columns, faults, followed, onset)


def information(
    law: RunLaw, columns: LawColumns, faults: FaultColumns, run: RunWindows, onset: int = 0
) -> Array:
    """Information on sizes from a window on, what recordings differ by integrated out.

    Shape (faults, faults), in 1 over the units of both sizes.
    """
    spread = law.spread()
    total = np.diag(spread.variance) + spread.covariance
    scale = np.sqrt(np.diag(total))
    scale = np.where(scale > 0.0, scale, 1.0)
    own = columns.of(run) * scale
    white = law.law_noise.whitened(run, np.concatenate((own, faults.of(run, onset)), axis=-1))
    sums, count = RunSums.of(white), len(scale)
    prior = np.linalg.inv(total / scale[:, None] / scale + 1e-12 * np.eye(count))
    mixed = sums.gram[count:, :count]
    kept = np.linalg.inv(prior + sums.gram[:count, :count])
    return np.asarray(sums.gram[count:, count:] - mixed @ kept @ mixed.T)


def _errors(information: Array) -> Array:
    return np.where(information > 0.0, 1.0 / np.sqrt(np.maximum(information, 1e-300)), np.inf)


def _beside(grams: Array, faults: FaultColumns) -> tuple[Array, tuple[tuple[str, ...], ...]]:
    """Information beside the most similar other fault, shape (recordings, faults)."""
    names = [column.fault for column in faults.columns]
    members = {name: [k for k, n in enumerate(names) if n == name] for name in names}
    own = np.einsum("nkk->nk", grams)
    least, alike = own.copy(), []
    for k, name in enumerate(names):
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


def _explained(block: Array, cross: Array) -> Array:
    """Information that these columns explain, for each recording; some may move nothing there."""
    solved = np.matmul(np.linalg.pinv(block, rcond=1e-10, hermitian=True), cross[..., None])
    return np.asarray((cross * solved[..., 0]).sum(axis=-1))
