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

"""Sizes of one fault by the whole of a recording, whether or not it was detected in it.

What a trend takes: each recording counts with all of its scans, in the same model. A size is held
to no bound, for what is below zero by its noise says as much as what is above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flea_diag.core.likelihood.fault_models import FaultModel, Size
from flea_diag.core.likelihood.fit import Fit, SizeError, Solution
from flea_diag.core.likelihood.likelihood import NormalEquations
from flea_diag.errors import ConfigurationError, shown
from flea_diag.stages.isolator.episode_evidence import EpisodeEvidence
from flea_diag.stages.isolator.parameters import Knowledge
from flea_diag.stages.isolator.quantitative_isolation import QuantitativeIsolation
from flea_diag.wire.blocks import ResidualBlock, block_of
from flea_diag.wire.records import Residual

SETTLES_S = 1.0
"""Start of a recording that is left out, in which motion and smoothing begin."""
PIECE_S = 4.0
"""Pieces by whose scatter the noise is known: longer than it is coloured, and some in 30 s."""
LEAST_PIECES = 3
"""A scatter of fewer says nothing."""


@dataclass(frozen=True)
class RecordingSize:
    """One size of the fault in one recording; ``load_n`` where the size goes with the load."""

    of: Size
    size: float
    error: SizeError
    load_n: float = math.nan


class RecordingSizes:
    """Takes the residuals of one recording after the other; ``sizes`` of the last one begun.

    Raises
    ------
    ConfigurationError
        The catalogue has no such fault, or no relation of the stand is moved by it.
    """

    def __init__(self, knowledge: Knowledge, fault: str) -> None:
        self._k, self._q = (
            knowledge,
            QuantitativeIsolation(knowledge.calibration, knowledge.effects),
        )
        models = [model for model in self._q.models if model.fault == fault]
        if not models:
            known = ", ".join(dict.fromkeys(model.fault for model in self._q.models))
            raise ConfigurationError(
                f"fault {shown(fault)} has no size by these channels, choose among {known}"
            )
        self._model = _unbounded(models[0])
        self._pieces: list[EpisodeEvidence] = []
        self._start_ns = -1

    def begin(self) -> None:
        """Another recording."""
        self._pieces, self._start_ns = [], -1

    def add(self, given: Residual | ResidualBlock) -> None:
        """Residuals of the observer, in order."""
        block = block_of(given) if isinstance(given, Residual) else given
        if self._start_ns < 0:
            self._start_ns = int(block.stamps_ns[0])
        times_s = (block.stamps_ns - self._start_ns) / 1e9 - SETTLES_S
        numbers = np.floor(times_s / PIECE_S).astype(int)
        for number in np.unique(numbers[numbers >= 0]).tolist():
            rows = np.flatnonzero(numbers == number)
            while len(self._pieces) <= number:
                self._pieces.append(self._evidence())
            self._pieces[number].add(block.part(slice(int(rows[0]), int(rows[-1]) + 1)))

    def _evidence(self) -> EpisodeEvidence:
        calibration = self._k.calibration
        return EpisodeEvidence(
            self._q.names,
            self._q.basis,
            self._q.acting,
            self._start_ns,
            0,
            calibration.parameters,
            self._k.effects.residuals,
            calibration.counts,
        )

    def sizes(self) -> tuple[RecordingSize, ...]:
        """Sizes that the recording determines; none of a recording with too little motion."""
        pieces = [piece.equations for piece in self._pieces if piece.moving]
        if len(pieces) < LEAST_PIECES:
            return ()
        whole = NormalEquations(self._q.names, self._q.basis)
        for piece in pieces:
            whole.take(piece, 1.0)
        fit = self._fit(whole)
        share = np.array(self._q.weights.run_share)
        assert isinstance(fit.solution, Solution)
        errors = fit.solution.errors(share, [piece.now for piece in pieces])
        return tuple(
            RecordingSize(of, size, error)
            for of, size, error in zip(self._model.sizes, fit.sizes, errors, strict=True)
            if error.total > 0.0
        )

    def _fit(self, evidence: NormalEquations) -> Fit:
        weights = self._q.weights
        (fit,) = evidence.fit([self._model], weights.sigma, weights.correlation, weights.tolerances)
        return fit


def _unbounded(model: FaultModel) -> FaultModel:
    sizes = tuple(replace(size, low=-math.inf, high=math.inf) for size in model.sizes)
    return replace(model, sizes=sizes, roughness=0.0)
