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

"""The isolation side of an episode: hypotheses, evidence, feature query and progress."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.isolation.fault_pairs import members
from flea_diag.core.isolation.hypothesis import Hypothesis
from flea_diag.core.isolation.isolation import Isolation
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.stages.episode import Episode
from flea_diag.stages.isolator.episode_evidence import EpisodeEvidence
from flea_diag.stages.isolator.feature_query import FeatureQuery
from flea_diag.stages.isolator.pairs.second_fault import SecondFault
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Recurrence, Symbols

CONCLUSIVE_S = 0.5
"""Time of evidence before likelihoods or absent symptoms may drop a fault."""
BOTH_WAYS_S = 0.3
"""Time in each direction of motion before parity residuals may decide by likelihood."""

SETTLED = (Outcome.ISOLATED, Outcome.INDISTINGUISHABLE, Outcome.UNEXPLAINED)
"""Outcomes of a settled episode."""


@dataclass
class FaultEpisode:
    """State of the isolator beside the ``Episode`` shared with the observer.

    ``symbols``: residual, magnitude and slope of each symbol observed. ``step`` counts verdicts
    and requests. ``settled``: features may be asked for. ``evaluated``: half seconds evaluated.
    ``resumed``: an isolator that was killed had begun it. ``recurrence``: how what is left
    comes and goes; None: it stays, as far as is known.
    """

    shared: Episode
    residuals: ResidualSet
    isolation: Isolation
    evidence: EpisodeEvidence
    query: FeatureQuery
    symbols: tuple[tuple[str, str, str], ...] = ()
    step: int = 0
    settled: bool = False
    evaluated: int = 0
    resumed: bool = False
    second: SecondFault = field(default_factory=SecondFault)
    recurrence: Recurrence | None = None

    def group(self) -> dict[str, float]:
        """Faults still possible, each with its probability."""
        return {h.name: h.probability for h in self.isolation.alive()}

    def names(self) -> tuple[str, ...]:
        """Faults still possible, the most probable first."""
        return tuple(h.name for h in self.isolation.alive())

    def said(self) -> tuple[str, ...]:
        """Names of the verdict: of the faults still possible, or of the pairs."""
        pairs = self.second.pairs
        return tuple(members(pairs)) if pairs else self.names()

    def magnitudes(self) -> dict[str, str]:
        """Magnitude symbol of every residual that has deviated."""
        return {residual: magnitude for residual, magnitude, _ in self.symbols}

    def take_over(self) -> None:
        """The observer was restarted: only a reset ends this episode."""
        self.shared = replace(self.shared, taken_over=True)

    def resume(self, verdict: AmbiguityGroup) -> None:
        """Go on from the last verdict on this episode: evidence is lost, what was dropped is not.

        What an observer that was restarted as well will show is still to come.
        """
        self.settled = verdict.outcome in SETTLED and not self.shared.taken_over
        self.shared = replace(self.shared, number=verdict.episode)
        self.step, self.resumed = verdict.step + 1, True
        self.second.resume(verdict.pairs)
        self.isolation.resume({each.fault: each.reason for each in verdict.dropped})

    @property
    def is_of_sensor(self) -> bool:
        """Whether the own test of a single sensor has deviated: that is no other fault's doing."""
        own = {row.name for row in self.residuals.sensor_rows}
        return any(residual in own for residual, _, _ in self.symbols)

    def recur(self, stamp_ns: int, fits: Mapping[str, Fit], recurrence: Recurrence) -> None:
        """These faults come and go: all that is known of them is in the times at which they came.

        What dropped a fault before took it for one that stays.
        """
        self.isolation.recur(stamp_ns, fits)
        self.recurrence, self.settled = recurrence, True

    def join(self, detection: Detection) -> None:
        """The observer now detects as well what vibration opened."""
        self.shared = self.shared.joined_by(detection)

    def observe(self, record: Symbols, quadrants: Sequence[Quadrant]) -> None:
        """Compare new symbols with the hypotheses; they say nothing of what comes and goes."""
        if self.recurrence is not None:
            return
        for symbol in record.symbols:
            seen = (symbol.residual, symbol.magnitude, symbol.slope)
            if seen not in self.symbols and not self._is_unit_shift(symbol.residual):
                self.symbols += (seen,)
                self.isolation.observe(
                    record.stamp_ns, *seen, quadrants=quadrants, settled=self.settled
                )

    def _is_unit_shift(self, residual: str) -> bool:
        """Whether this residual has only left its earlier level, in an episode vibration opened."""
        shared = self.shared
        relation = self.residuals.relation
        return shared.opened_by_vibration and relation(residual) == relation(shared.opening_shift)

    @property
    def yields_to_vibration(self) -> bool:
        """Whether only the circuit has deviated: a vibration alarm then opens its own episode.

        A unit exchanged for another has another winding, and may have a fault of its screw.
        """
        deviating = (self.shared.opening_shift, *(residual for residual, _, _ in self.symbols))
        return not self.shared.opened_by_vibration and all(map(self._is_circuit, deviating))

    @property
    def is_vibration_only(self) -> bool:
        """Whether vibration deviates and no relation does: the absence of drag is evidence then."""
        shared = self.shared
        return shared.opened_by_vibration and not self.symbols and not shared.opening_shift

    @property
    def awaits_symbols(self) -> bool:
        """Whether an innovation has detected, and no relation has deviated yet."""
        return not self.symbols and not self.settled

    @property
    def told_by(self) -> str:
        """The residual that deviated first; empty: none has."""
        return self.symbols[0][0] if self.symbols else ""

    @property
    def relations_seen(self) -> set[str]:
        """Relations of the residuals that have deviated."""
        return {self.residuals.relation(name) for name, _, _ in self.symbols}

    def gains_less(
        self, nats: float, quantified: Collection[str], alive: Sequence[Hypothesis]
    ) -> bool:
        """Whether no quantified hypothesis explains the residuals by so much better than none."""
        deviating = self.relations_seen
        if not deviating or not deviating <= set(quantified):
            return False
        if any(h.fit is None for h in alive) or self.evidence.mostly_stands:
            return False
        return max(h.log_likelihood for h in alive) < nats

    def unweighed(self) -> tuple[str, ...]:
        """Residuals that contradict a settled group, and of which no amount says anything."""
        sums, relation = self.evidence.equations.now, self.residuals.relation
        weighed = {n for n, blocks in zip(sums.residuals, sums.blocks, strict=True) if blocks}
        return tuple(sorted(r for r in self.isolation.overruled if relation(r) not in weighed))

    def without_value(self) -> frozenset[str]:
        """Weighed relations that have had no value in the last seconds."""
        now = self.evidence.equations.now
        sums = self.second.recent(now) or now
        rows = zip(sums.residuals, sums.blocks, strict=True)
        return frozenset(name for name, count in rows if count < 1.0)

    def is_conclusive(self) -> bool:
        """Whether likelihoods may drop faults.

        In one direction of motion drag and bias are not isolable, unless the circuit deviates as
        well, which no drag causes.
        """
        if self.asks_both_ways:
            return self.evidence.goes_both_ways(BOTH_WAYS_S)
        return self.evidence.lasts(CONCLUSIVE_S)

    @property
    def asks_both_ways(self) -> bool:
        """Whether the balance with the friction deviates, and the circuit does not."""
        seen = self.magnitudes()
        relations = {self.residuals.relation(residual) for residual in seen}
        return self.residuals.friction in relations and self.residuals.circuit not in seen

    def _is_circuit(self, residual: str) -> bool:
        """Whether this residual is of the relation of the winding."""
        return bool(residual) and self.residuals.relation(residual) == self.residuals.circuit
