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

"""Rows of one stream: what each window leaves of the relations, in standard deviations of the law.

What the stream itself differs by is told from its quiet windows alone, so that a fault that comes
and goes is not learned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.evidence.white_stream import (
    exact_share,
    predicted_sigma,
    weight_of,
)
from flea_diag.core.frozen import Frozen
from flea_diag.core.recurrence.recurring import NEAR
from flea_diag.core.run_law.law_noise import left_beside
from flea_diag.core.run_law.run_windows import WINDOW_S

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SOLVED_EVERY = 5
"""Quiet windows from one solution for what the stream differs by to the next: 1 s."""


class _Moments(NamedTuple):
    """Of moments in windows, what ``WindowRows`` holds of these; ``known``: what has a value."""

    known: Flags
    raw: Array
    predicted: Array
    apart: Array


@dataclass(frozen=True, eq=False)
class WindowRows(Frozen):
    """Windows that follow each other.

    Attributes
    ----------
    errors
        Of prediction under no fault, in standard deviations, shape (n, relations), 0 without a
        value.
    window, first
        What they are of, and the number of the first since the start.
    raw
        Errors before what sensors share was taken off.
    predicted
        Standard deviations of the predictions, shape (n, relations); infinite without a value.
    apart
        Takes off what relations share, shape (n, relations, relations).
    """

    errors: Array
    window: LawWindow
    first: int
    raw: Array
    predicted: Array
    apart: Array

    @property
    def farthest(self) -> Array:
        """Standard deviations that the farthest relation of each is out, shape (n,)."""
        return np.asarray(np.abs(self.errors).max(axis=1))

    def added(self, hypotheses: StreamHypotheses) -> tuple[Array, Array]:
        """What faults and another unit add to the errors.

        Returns
        -------
        For one unit of each size, shape (n, relations, models * sizes), and for one standard
        deviation of each difference, shape (n, relations, differences).
        """
        numbers = self.first + np.arange(len(self.errors))
        faults, _ = hypotheses.faults(self.window, self.raw)
        both = faults, hypotheses.of_unit(self.window, numbers)
        one, other = (self.apart @ (each / self.predicted[..., None]) for each in both)
        return one, other

    def within(
        self, hypotheses: StreamHypotheses, moments: LawWindow, model: int, size: Array
    ) -> tuple[Array, Array]:
        """Errors of as many moments in each window, and what a fault of this size adds to them.

        Both of shape (moments, relations), in standard deviations of a moment.
        """
        known, raw, predicted, apart = self._moments(hypotheses, moments)
        added = hypotheses.effect(moments, raw, model, size) / predicted
        errors, effect = ((apart @ each[..., None])[..., 0] for each in (raw, added * known))
        return errors, effect

    def all_within(
        self, hypotheses: StreamHypotheses, moments: LawWindow
    ) -> tuple[Array, Array, Array]:
        """Errors of as many moments in each window, and what faults and another unit add to them.

        See ``within`` and ``added``.
        """
        known, raw, predicted, apart = self._moments(hypotheses, moments)
        numbers = np.repeat(self.first + np.arange(len(self.errors)), len(raw) // len(self.errors))
        faults, _ = hypotheses.faults(moments, raw)
        both = faults, hypotheses.of_unit(moments, numbers)
        scale = (known / predicted)[..., None]
        one, other = (apart @ (each * scale) for each in both)
        return (apart @ raw[..., None])[..., 0], one, other

    def _moments(self, hypotheses: StreamHypotheses, moments: LawWindow) -> _Moments:
        """Moments, whose noise is taken to be white.

        What the stream differs by hardly changes within a window.
        """
        count = len(moments.values) // len(self.errors)
        of_moment = partial(np.repeat, repeats=count, axis=0)
        left = hypotheses.left(moments, of_moment(self.first + np.arange(len(self.errors))))
        quieter = hypotheses.loudness(moments) / of_moment(hypotheses.loudness(self.window))
        predicted = math.sqrt(count) * quieter * of_moment(self.predicted)
        known = np.isfinite(left) & np.isfinite(predicted)
        found = np.where(known, left, 0.0).reshape(len(self.errors), count, -1)
        of_window = found.sum(axis=1) / np.maximum(known.reshape(found.shape).sum(axis=1), 1)
        beside = np.where(known, left - of_moment(of_window), 0.0) / predicted
        whole = of_moment(self.raw) / (math.sqrt(count) * quieter)
        raw = np.where(known, beside + whole, 0.0)
        return _Moments(known, raw, predicted, of_moment(self.apart))

    def one(self, k: int) -> WindowRows:
        """One of these windows."""
        which = slice(k, k + 1)
        return WindowRows(
            self.errors[which], self.window.part(which), self.first + k, self.raw[which],
            self.predicted[which], self.apart[which],
        )  # fmt: skip

    @staticmethod
    def joined(pieces: Sequence[WindowRows]) -> WindowRows:
        """Pieces that follow each other."""
        every = ((p.errors, p.raw, p.predicted, p.apart) for p in pieces)
        errors, raw, predicted, apart = map(np.concatenate, zip(*every, strict=True))
        window = LawWindow.joined([p.window for p in pieces])
        return WindowRows(errors, window, pieces[0].first, raw, predicted, apart)


class _Standing(NamedTuple):
    """What windows hold whatever is known of the stream: values and columns in the noise alone."""

    rows: Array
    sigma: Array
    known: Flags


class StreamRows:
    """Makes the rows of one stream.

    ``fast``, shape (relations,): those that are looked at. A slow store is predicted from a
    detection on without a correction, and says nothing of a burst.
    """

    def __init__(self, hypotheses: StreamHypotheses, fast: Flags) -> None:
        self._h, self._fast = hypotheses, fast
        self._fade = math.exp(-SOLVED_EVERY * WINDOW_S / hypotheses.memory_s)
        noise = hypotheses.noise
        # Neighbouring windows are alike: of what lasts they tell less than their number says.
        self._alike = np.maximum(noise.long_run / noise.sigma, 1.0)[:, None]
        self._one = np.eye(len(fast))
        self._number = 0
        self.forget()

    def forget(self) -> None:
        """Zeros of this unit have been learned: what is left of them is another quantity now."""
        count = self._h.own_count
        self._sums = np.zeros((count, count))
        self._quiet: list[Array] = []
        self._solve()

    def add(self, windows: LawWindow) -> WindowRows:
        """Take windows; their rows."""
        every, first, begun = self._standing(windows), self._number, 0
        errors, scatter = np.empty_like(every.sigma), np.empty_like(every.sigma)
        self._number += len(errors)
        while begun < len(errors):
            # As far as one solution holds.
            which = slice(begun, begun + SOLVED_EVERY - len(self._quiet))
            errors[which], scatter[which] = self._predicted(every.rows[which])
            begun = which.stop
        return self._rows(windows, first, every, errors, scatter)

    def _standing(self, windows: LawWindow) -> _Standing:
        h, known = self._h, np.isfinite(windows.values) & self._fast
        left, psi = h.own(windows, self._number + np.arange(len(known)))
        sigma = h.loudness(windows) * h.noise.sigma
        rows = np.concatenate((left[..., None], psi), axis=-1) / sigma[..., None]
        rows[~known] = 0.0
        return _Standing(rows, sigma, known)

    def _predicted(self, rows: Array) -> tuple[Array, Array]:
        """Errors of prediction, and standard deviations of it; learns of what is quiet."""
        scatter = predicted_sigma(rows, self._covariance)
        errors = left_beside(rows, self._eta) / scatter
        quiet = np.abs(errors).max(axis=1) <= NEAR
        self._quiet.extend((rows * weight_of(errors) / self._alike)[quiet])
        if len(self._quiet) == SOLVED_EVERY:
            told = np.concatenate(self._quiet)
            self._sums = self._fade * self._sums + told.T @ told
            self._quiet = []
            self._solve()
        return errors, scatter

    def _rows(
        self, window: LawWindow, first: int, standing: _Standing, errors: Array, scatter: Array
    ) -> WindowRows:
        """Rows of windows with these errors."""
        sigma, known = standing.sigma, standing.known
        predicted = np.where(known, sigma * scatter, np.inf)
        # Of a deviation that no model gives exactly, little is the noise of a shared sensor.
        both = known[:, :, None] & known[:, None]
        others = self._h.noise.of_others(window.signals)
        shared = others * np.square(exact_share(errors)[..., 0])[:, None]
        scale = sigma[:, None] / sigma[:, :, None]
        apart = self._one - np.where(both, shared * scale, 0.0)
        own = (apart @ errors[..., None])[..., 0]
        return WindowRows(own, window, first, errors, predicted, apart)

    def _solve(self) -> None:
        """What the stream differs by so far: mean and covariance."""
        inner = np.eye(len(self._sums) - 1) + self._sums[1:, 1:]
        self._covariance = np.asarray(np.linalg.inv(inner), dtype=np.float64)
        self._eta = self._covariance @ self._sums[1:, 0]
