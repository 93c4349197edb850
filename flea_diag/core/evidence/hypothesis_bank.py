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

"""Evidence of every fault, and of another unit, from each of many onsets, window by window.

An onset begins every ``ONSET_WINDOWS`` windows. The bank keeps the start of the stream, the last
``DENSE`` onsets, and farther back ever fewer, down to ``OLDEST`` onsets ago: memory and time are
constant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flea_diag.core.evidence.hypotheses import StreamHypotheses
from flea_diag.core.evidence.marginal_ratio import Sums
from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.evidence.white_stream import WhiteStream, weight_of
from flea_diag.core.run_law.run_windows import WINDOW_S
from flea_diag.core.run_law.whitening import WhiteSignals

Array = npt.NDArray[np.float64]

ONSET_WINDOWS = 2
"""From onset to onset, about the smoothing of the readings."""
DENSE, OLDEST = 8, 64  # assumption: a fault that is not seen within 26 s grows


class Weighed(NamedTuple):
    """Log evidence by onset, nats: of faults over healthy (onsets, models), of another unit."""

    faults: Array
    unit: Array


class HypothesisBank:
    """Sums of one stream, from its start and from every onset of the bank."""

    def __init__(self, hypotheses: StreamHypotheses, since_start: int = 0) -> None:
        self._h = hypotheses
        self._fade = float(np.exp(-WINDOW_S / hypotheses.memory_s))
        self.stream = WhiteStream(hypotheses, since_start)
        relations = len(hypotheses.noise.white)
        models, sizes = hypotheses.signatures.shape
        units, own = hypotheses.unit.shape[1], hypotheses.own_count
        self._white = WhiteSignals((1, relations, models * sizes + units))
        self._gram = np.zeros((1, models, sizes, sizes))
        self._cross = np.zeros((1, models * sizes, own))
        self._unit_gram = np.zeros((1, units, units))
        self._unit_cross = np.zeros((1, units, own))
        self.onsets = np.zeros(1, dtype=np.int64)
        """Number of the window at which each begins; the first is the start of the stream."""
        self.errors = np.full(relations, np.nan)
        """Standardised errors of the last window under no fault, shape (relations,)."""

    @property
    def windows(self) -> int:
        """Windows taken so far."""
        return self.stream.windows

    @property
    def is_due(self) -> bool:
        """Whether the evidence is worth looking at: as often as onsets begin."""
        return self.windows % ONSET_WINDOWS == 0

    def add(self, window: LawWindow) -> None:
        """Take one window; every second one begins an onset."""
        if self.windows and self.windows % ONSET_WINDOWS == 0:
            self._begin()
        since_s = (self.windows - self.onsets + 0.5) * WINDOW_S
        white = self.stream.step(window)
        self.errors = white.errors
        weight = weight_of(white.errors)
        own = white.own * weight
        self.stream.count(own, self._fade)
        faults = white.faults + since_s[:, None, None] * white.growing
        unit = np.broadcast_to(white.unit, (len(since_s), *white.unit.shape))
        later = self._white.step(np.concatenate((faults, unit), axis=-1), white.gain)
        self._sum(own, later * white.scale * weight)

    def weighed(self, least: float = 0.0) -> Weighed:
        """Of every model and of another unit from every onset.

        What healthy recordings feign only takes away: it is weighed where a fault is beyond
        ``least``.
        """
        own, (models, sizes) = self.stream.sums, self._h.signatures.shape
        cross = self._cross.reshape(len(self.onsets), models, sizes, -1)
        sums = Sums(self._gram, cross, own)
        faults = self._h.evidence(sums)
        if faults.max() > least:
            faults = faults - self._h.of_healthy(sums, self.onsets == 0)
        return Weighed(faults, self._unit_evidence())

    def _unit_evidence(self) -> Array:
        """Of another unit from every onset, in prior deviations, what a run differs by beside."""
        own = self.stream.sums
        kept = np.linalg.inv(np.eye(len(own) - 1) + own[1:, 1:])
        explained = np.matmul(self._unit_cross[..., 1:], kept)
        gram = self._unit_gram - np.matmul(explained, self._unit_cross[..., 1:].swapaxes(-1, -2))
        pull = self._unit_cross[..., 0] - explained @ own[1:, 0]
        inner = np.eye(gram.shape[-1]) + gram
        gain = (pull * np.linalg.solve(inner, pull[..., None])[..., 0]).sum(axis=-1)
        return np.asarray(0.5 * (gain - np.linalg.slogdet(inner)[1]))

    def _begin(self) -> None:
        """Begin an onset, and drop those that are too dense for their age."""
        ages = (self.windows - self.onsets) // ONSET_WINDOWS
        numbers = self.onsets // ONSET_WINDOWS
        spacing = 2 ** np.maximum(np.floor(np.log2(np.maximum(ages, 1) / DENSE)) + 1, 0)
        kept = (numbers % spacing == 0) & (ages <= OLDEST)
        kept[0] = True
        self._white.keep(kept)
        self._white.begin()
        self.onsets = np.append(self.onsets[kept], self.windows)
        sums = (self._gram, self._cross, self._unit_gram, self._unit_cross)
        self._gram, self._cross, self._unit_gram, self._unit_cross = (
            _extended(entry[kept]) for entry in sums
        )

    def _sum(self, own: Array, white: Array) -> None:
        """Add the products of one window; white: shape (onsets, relations, sizes + units)."""
        models, sizes = self._h.signatures.shape
        flat, unit = white[..., : models * sizes], white[..., models * sizes :]
        shaped = flat.reshape(*flat.shape[:2], models, sizes).transpose(0, 2, 3, 1)
        self._gram = self._fade * self._gram + np.matmul(shaped, shaped.swapaxes(-1, -2))
        self._cross = self._fade * self._cross + np.matmul(flat.swapaxes(-1, -2), own)
        self._unit_gram = self._fade * self._unit_gram + np.matmul(unit.swapaxes(-1, -2), unit)
        self._unit_cross = self._fade * self._unit_cross + np.matmul(unit.swapaxes(-1, -2), own)


def _extended(sums: Array) -> Array:
    return np.concatenate((sums, np.zeros((1, *sums.shape[1:]))))
