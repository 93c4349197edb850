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

"""Parts of a fault: of what comes and goes each window may hold another one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.fault_signatures import SizePrior
from flea_diag.core.evidence.marginal_ratio import Sums, marginal_ratio, posterior
from flea_diag.core.evidence.white_stream import exact_share
from flea_diag.core.recurrence.stream_part import StreamPart

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

EXPLAINED = 0.5
"""Share of the squares of all bursts that a fault must explain."""


@lru_cache(maxsize=16)
def of_a_part(prior: SizePrior) -> SizePrior:
    """Sizes of which a part is there: of any that a fault may have, and none.

    The windows about an end of a burst hold part of it, and where most bursts are no longer than
    that, a part is all that shows. What a machine does in motion hides more: without a supply it
    coasts, and its back-EMF stands at the terminals as if nothing were lost.
    """
    low, high = np.minimum(prior.low, 0.0), np.maximum(prior.high, 0.0)
    bounded = np.isfinite(low) & np.isfinite(high)
    span = np.where(bounded, high - low, 0.0)
    mean = np.where(bounded, np.where(bounded, low, 0.0) + 0.5 * span, prior.mean)
    sigma = np.where(bounded, span / math.sqrt(12.0), prior.sigma)
    return replace(prior, mean=mean, sigma=sigma, low=low, high=high)


class Parts(NamedTuple):
    """Of windows of which each holds a part of its own.

    Attributes
    ----------
    nats
        Evidence of each model, shape (n, models).
    fits
        Whether it explains most of a window, shape (n, models).
    largest
        Size in the window that shows most of it, shape (models, sizes).
    """

    nats: Array
    fits: Flags
    largest: Array


def in_parts(part: StreamPart, which: Flags, prior: SizePrior) -> Parts:
    """Parts of every model in these windows."""
    errors, faults = part.errors[which], part.faults[which]
    exact = exact_share(errors)
    phi = np.moveaxis(faults * exact[..., None], 1, -1)
    cross = phi @ (errors[..., None] * exact)[:, None]
    sums = Sums(phi @ np.swapaxes(phi, -1, -2), cross, np.zeros((1, 1)))
    nats, size = marginal_ratio(sums, prior), posterior(sums, prior).size
    left = errors[:, None] - np.einsum("nrks,nks->nkr", faults, size)
    shown = np.square(errors).sum(axis=-1)[:, None]
    fits = np.square(left).sum(axis=-1) < (1.0 - EXPLAINED) * shown
    most = np.expand_dims(nats.argmax(axis=0), (0, 2))
    return Parts(nats, fits, np.take_along_axis(size, most, axis=0)[0])


class InOneForm(NamedTuple):
    """Evidence of models that are all weighed in one form, shape (models,).

    ``told`` is that of the windows, shape (n, models), which each ``fits``.
    """

    nats: Array
    told: Array
    fits: Flags


def in_one_form(nats: Array, parts: Parts, models: Sequence[int]) -> InOneForm:
    """One size in all windows or parts, whichever explains more of the best of these models.

    What the machine hides, it hides of each of them.
    """
    in_parts = np.maximum(parts.nats, 0.0).sum(axis=0)  # where it does not show, it is not there
    if in_parts[models].max() > nats[models].max():
        return InOneForm(in_parts, (parts.nats * parts.fits).sum(axis=0), parts.fits)
    return InOneForm(nats, nats, np.ones_like(parts.fits))
