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


"""Candidates of a verdict: what is known of each fault, alone or as one of two."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from flea_diag.core.faults.response import Response
from flea_diag.core.isolation.fault_pairs import FaultPair, members
from flea_diag.core.isolation.hypothesis import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.fit import Fit
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.wire.records import Candidate, Evidence

Array = npt.NDArray[np.float64]
Candidates = tuple[Candidate, ...]


@dataclass(frozen=True)
class FittedSizes:
    """What a fit says of the size of its fault.

    ``run_share`` is what recordings of one unit differ by, in shares of what units do; empty: not
    known.
    """

    models: Sequence[FaultModel]
    run_share: Array

    def of(self, name: str, fit: Fit | None) -> tuple[float, float, str, float]:
        """Size, standard error, unit and own error; NaN where there is none."""
        if fit is None:
            return math.nan, math.nan, "", math.nan
        sizes = fit.sizes
        model = next(m for m in self.models if m.fault == name and len(m.sizes) == len(sizes))
        # The first size that is not 0: a drag may be purely viscous.
        index = next((k for k, value in enumerate(sizes) if value), 0)
        errors = fit.errors(self.run_share) if len(self.run_share) else ()
        own = errors[index].own if errors else math.nan
        return sizes[index], fit.sigmas[index], model.sizes[index].unit, own


def candidates(
    episode: FaultEpisode, sizes: FittedSizes
) -> tuple[Candidates, Candidates, list[Response]]:
    """Members, faults ruled out, and what people do about the members."""
    isolation, pairs = episode.isolation, episode.second.pairs
    if not pairs:
        alive = isolation.alive()
        return (
            tuple(_candidate(h, sizes) for h in alive),
            tuple(_candidate(h, sizes) for h in isolation.dropped()),
            [h.fault.response for h in alive],
        )
    known, names = isolation.hypotheses, members(pairs)
    return (
        tuple(_of_pairs(known[name], share, pairs, sizes) for name, share in names.items()),
        tuple(_beside(known[name], names, sizes) for name in known if name not in names),
        [known[name].fault.response for name in names],
    )


def _beside(hypothesis: Hypothesis, names: Mapping[str, float], sizes: FittedSizes) -> Candidate:
    """A fault that is none of both."""
    why = hypothesis.why_dropped or f"explains less than two faults of {', '.join(names)} do"
    return replace(_candidate(hypothesis, sizes), probability=0.0, reason=why)


def _of_pairs(
    hypothesis: Hypothesis,
    share: float,
    pairs: Sequence[FaultPair],
    sizes: FittedSizes,
) -> Candidate:
    """One of two faults: its size beside the most probable partner."""
    name = hypothesis.name
    best = next(pair for pair in pairs if name in pair.faults)
    partner = next(each for each in best.faults if each != name)
    fit = best.fits[best.faults.index(name)]
    return replace(
        _candidate(hypothesis, sizes, fit if fit.sizes else None),
        probability=share,
        reason=f"explains with {partner} what no fault does alone",
    )


def _candidate(hypothesis: Hypothesis, sizes: FittedSizes, fit: Fit | None = None) -> Candidate:
    size, sigma, unit, own = sizes.of(hypothesis.name, fit or hypothesis.fit)
    return Candidate(
        hypothesis.name,
        hypothesis.fault.deviation,
        hypothesis.probability if not hypothesis.why_dropped else 0.0,
        hypothesis.why_dropped or hypothesis.why_kept,
        tuple(
            Evidence(c.stamp_ns, c.source, c.observed, c.predicted, c.words, c.path)
            for c in hypothesis.checks
        ),
        size,
        sigma,
        unit,
        own,
    )
