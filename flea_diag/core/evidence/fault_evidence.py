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

"""Evidence on a fault from one onset: the recent windows once more, without those about the onset.

These hold part of the fault, smoothed: to no model do they look like it. No model gives a large
deviation exactly, so beyond what the noise is a share of it counts as noise. A stream that was
louder than its law before the onset is taken to be as loud since (quasi-likelihood); where the
onset is its start, by what even the model that fits best leaves.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.hypothesis_bank import ONSET_WINDOWS
from flea_diag.core.evidence.marginal_ratio import (
    Sums,
    marginal_ratio,
    posterior,
    posterior_mean,
)
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.evidence.white_stream import (
    WhiteStream,
    WhiteWindow,
    exact_share,
    standardised,
    weight_of,
)
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.whitening import WhiteSignals

Array = npt.NDArray[np.float64]

LAW_WINDOWS = 10
"""Windows for which the noise of the law stands beside that of a stream before an onset."""
KEPT_S = 60.0
"""History that is weighed once more after a detection."""
KEPT_WINDOWS = round(KEPT_S / WINDOW_S)


class StreamHistory:
    """The last ``KEPT_WINDOWS``, and how many there were."""

    def __init__(self) -> None:
        self.windows: deque[LawWindow] = deque(maxlen=KEPT_WINDOWS)
        self.taken = 0

    def add(self, window: LawWindow) -> None:
        """Take one window."""
        self.windows.append(window)
        self.taken += 1

    def since(self, number: int) -> list[LawWindow]:
        """Windows from this number on, as far as they are kept."""
        first = self.taken - len(self.windows)
        return list(self.windows)[max(number - first, 0) :]


class OnsetWeighed(NamedTuple):
    """Log evidence, nats.

    Attributes
    ----------
    alone
        Of every model over nothing, shape (models,).
    with_unit
        Of every model with another unit over another unit, shape (models,).
    unit
        Of another unit over nothing.
    healthy, healthy_unit
        Of what healthy recordings feign of every model, over nothing and over another unit.
    size, sigma
        Of every model and its standard error, shape (models, sizes).
    left
        Mean square that every model leaves in each relation, in the variance of its noise, shape
        (relations, models); ``shown`` of none of them, shape (relations,).
    windows
        Number of each relation, shape (relations,).
    """

    alone: Array
    with_unit: Array
    unit: float
    healthy: Array
    healthy_unit: Array
    size: Array
    sigma: Array
    left: Array
    shown: Array
    windows: Array

    @property
    def every(self) -> Array:
        """Of every model over nothing, whether it came alone or with another unit."""
        return np.asarray(np.logaddexp(self.alone, self.unit + self.with_unit) - math.log(2.0))


class FaultEvidence:
    """Sums of white residuals, of what another unit and what faults add from one onset on.

    A fault comes alone, or with another unit: that control went over to a faulty one is as likely.
    Sums since the onset are kept by relation. ``onset`` is a number of these windows,
    ``since_start`` how many the stream had before them. ``beside`` are other onsets that it is
    weighed against: what is left out for one is left out for all, or their evidence would be of
    different windows.
    """

    def __init__(
        self, hypotheses: StreamHypotheses, onset: int, windows: Iterable[LawWindow] = (),
        since_start: int = 0, beside: Collection[int] = (),
    ) -> None:  # fmt: skip
        self._h, self._onset = hypotheses, onset
        self._smoothed = smoothed({onset, *beside})
        models, sizes = hypotheses.signatures.shape
        relations, self._alone = len(hypotheses.noise.white), hypotheses.own_count
        own = self._alone + hypotheses.unit.shape[1]
        self._stream = WhiteStream(hypotheses, since_start)
        self._later = WhiteSignals((relations, models * sizes + own - self._alone))
        self._before = np.zeros((own, own))
        self._own = np.zeros((relations, own, own))
        self._gram = np.zeros((relations, models, sizes, sizes))
        self._cross = np.zeros((relations, models, sizes, own))
        self._count = np.zeros(relations)
        self._quiet = np.full((2, relations), float(LAW_WINDOWS))
        self.errors = np.full(relations, np.nan)
        """Standardised errors of the last window under no fault, shape (relations,)."""
        self._seen = np.zeros((2, relations))
        self._ways: set[int] = set()
        self._now = self._most = 0.0
        for window in windows:
            self.add(window)

    def add(self, window: LawWindow) -> None:
        """Take one window."""
        since = self._stream.windows - self._onset
        white = self._stream.step(window, counts=self._stream.windows not in self._smoothed)
        self.errors = white.errors
        effect = white.faults + (since + 0.5) * WINDOW_S * white.growing
        both = np.concatenate((effect, white.unit), axis=-1) * (since >= 0)
        later = self._later.step(both, white.gain) * white.scale
        count = effect.shape[-1]
        phi = later[:, :count].reshape(len(later), *self._h.signatures.shape)
        if since < 0:
            self._take_quiet(white)
            return
        self._ways.add(int(self._h.friction.way(window)))
        errors = np.nan_to_num(white.errors)
        self._count += np.isfinite(white.errors)
        self._seen += errors, np.square(errors)
        own = np.concatenate((white.own, later[:, count:]), axis=-1)
        # From the start of a stream nothing says yet how far a reading may be off.
        exact = exact_share(white.deviations if self._onset else white.errors)
        own, phi = own * exact, phi * exact[..., None]
        self._take(own, phi, weight_of(self._errors(own, phi)))

    def _take_quiet(self, white: WhiteWindow) -> None:
        """Add the products of one window before the onset, and how loud it is."""
        weight = weight_of(white.errors)
        rows = white.own * weight
        self._stream.count(rows, 1.0)
        self._before[: self._alone, : self._alone] += rows.T @ rows
        known = np.isfinite(white.errors)
        self._quiet += known, np.square(np.where(known, white.errors, 0.0) * weight[:, 0])

    def _take(self, own: Array, phi: Array, weight: Array) -> None:
        """Add the products of one window since the onset."""
        own, phi = own * weight, phi * weight[..., None]
        self._own += own[:, :, None] * own[:, None, :]
        self._gram += phi[..., :, None] * phi[..., None, :]
        self._cross += phi[..., None] * own[:, None, None, :]

    def _errors(self, own: Array, phi: Array) -> Array:
        """Errors of prediction by the best model so far, with another unit, (relations,)."""
        sums, prior = self._sums(np.ones(len(own)), self._own.shape[-1]), self._h.signatures.prior
        ratios = marginal_ratio(sums, prior)
        best = int(ratios.argmax())
        self._now = float(ratios[best])
        self._most = max(self._most, self._now)
        sigma, cross = np.maximum(prior.sigma[best], 1e-12), sums.cross[best]
        A = np.block([
            [sums.gram[best] + np.diag(sigma**-2), cross[:, 1:]],
            [cross[:, 1:].T, sums.own[1:, 1:] + np.eye(len(sums.own) - 1)],
        ])  # fmt: skip
        b = np.concatenate((cross[:, 0] + prior.mean[best] / sigma**2, sums.own[1:, 0]))
        covariance = np.asarray(np.linalg.inv(A), dtype=np.float64)
        rows = np.column_stack((own[:, 0], phi[:, best], own[:, 1:]))
        return standardised(rows, covariance @ b, covariance)

    @property
    def shown(self) -> tuple[Array, Array, Array]:
        """Windows since the onset, sum and sum of squares of their errors; each (relations,)."""
        return self._count, self._seen[0], self._seen[1]

    @property
    def ended(self) -> float:
        """Evidence that the fault ended with the window by which most spoke for it, nats.

        Over that it lasts: what explained the windows by then fits those since worse than nothing.
        """
        return self._most - self._now

    @property
    def windows(self) -> float:
        """Windows that count since the onset."""
        return float(self._count.max(initial=0.0))

    @property
    def goes_both_ways(self) -> bool:
        """Whether it has moved forth and back since the onset."""
        return {1, -1} <= self._ways

    def weighed(self, feigned: bool = True) -> OnsetWeighed:
        """Evidence of every model and of another unit.

        ``feigned``: also what healthy recordings feign; 0 without it.
        """
        h, ones = self._h, np.ones(len(self._own))
        widths = self._alone, self._own.shape[-1]
        plain = [self._sums(ones, width) for width in widths]
        left = np.minimum(*map(self._left, plain, widths))
        loud = self._quiet[1] / self._quiet[0] if self._onset else left.min(axis=1)
        scale = 1.0 / np.maximum(loud, 1.0)
        alone, both = (self._sums(scale, width) for width in widths)
        faults = h.evidence(alone)
        unit, before = self._unit(both.own, faults), self._onset == 0
        found, nothing = posterior(alone, h.signatures.prior), np.zeros(len(faults))
        healthy, with_unit = (
            h.of_healthy(sums, before) if feigned else nothing for sums in (alone, both)
        )
        return OnsetWeighed(
            faults, h.evidence(both), unit, healthy, with_unit,
            found.size, found.sigma, left, self._shown(plain[0].own), self._count.copy(),
        )  # fmt: skip

    def _unit(self, own: Array, faults: Array) -> float:
        """Log evidence of another unit over nothing, nats.

        It may stand in another room; but a room that is all that has changed is an error of its
        thermometer. So the room adds no more than such an error explains, which may explain more:
        it reaches farther, and what it does to a part is not the room's.
        """
        h, alone = self._h, self._alone
        unit = other_unit(own, alone)
        if not (h.room.any() and h.room_models.any()):
            return unit
        kept = np.concatenate((np.ones(alone, dtype=bool), h.room))
        room = other_unit(own[np.ix_(kept, kept)], alone)
        return unit - room + min(room, max(float(faults[h.room_models].max()), 0.0))

    def _left(self, sums: Sums, count: int) -> Array:
        """Mean square that the models leave in each relation, shape (relations, models)."""
        theta, eta = posterior_mean(sums, self._h.signatures.prior)
        whole = np.concatenate((np.ones((len(eta), 1)), -eta), axis=1)
        own = np.matmul(whole, self._own[:, :count, :count])
        cross = np.matmul(self._cross[..., :count], whole[..., None])[..., 0]
        gram = np.matmul(self._gram, theta[..., None])[..., 0]
        square = (own * whole).sum(axis=-1) + ((gram - 2.0 * cross) * theta).sum(axis=-1)
        return np.asarray(square / np.maximum(self._count, 1.0)[:, None])

    def _shown(self, own: Array) -> Array:
        """The same of no fault."""
        eta = np.linalg.solve(np.eye(len(own) - 1) + own[1:, 1:], own[1:, 0])
        whole = np.concatenate(([1.0], -eta))
        square = self._own[:, : self._alone, : self._alone] @ whole @ whole
        return np.asarray(square / np.maximum(self._count, 1.0))

    def _sums(self, scale: Array, count: int) -> Sums:
        """Sums over all relations, each by what its misfit makes of its variance."""
        return Sums(
            np.tensordot(scale, self._gram, 1),
            np.tensordot(scale, self._cross[..., :count], 1),
            self._before[:count, :count] + np.tensordot(scale, self._own[:, :count, :count], 1),
        )


def smoothed(onsets: Iterable[int]) -> frozenset[int]:
    """Numbers of the windows about onsets that hold a part of a fault, smoothed."""
    about = range(-1, ONSET_WINDOWS)
    return frozenset(onset + k for onset in onsets if onset > 0 for k in about)


def other_unit(own: Array, alone: int) -> float:
    """Log evidence of the columns behind the first ``alone`` over none of them, nats."""
    whole, first = (own[1:n, 1:n] + np.eye(n - 1) for n in (len(own), alone))
    gains = [own[1 : len(m) + 1, 0] @ np.linalg.solve(m, own[1 : len(m) + 1, 0])
             for m in (whole, first)]  # fmt: skip
    dets = [np.linalg.slogdet(m)[1] for m in (whole, first)]
    return float(0.5 * (gains[0] - gains[1] - dets[0] + dets[1]))
