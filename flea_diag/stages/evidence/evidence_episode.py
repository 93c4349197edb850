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

"""The isolation side of an episode by the evidence: shares of the members, and what fits them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from flea_diag.core.causal_graph.operating_point import Quadrant
from flea_diag.core.evidence.change_evidence import ChangeEvidence
from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.isolation.hypothesis import ConsistencyCheck
from flea_diag.core.likelihood.fit import Fit
from flea_diag.stages.evidence.evidence_group import EvidenceGroup
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.wire.records import Symbols

NOT_SHOWN = "nothing that would define it has shown"
"""Of a fault that acts on no relation, or that the tests of single sensors exclude for now."""


@dataclass
class EvidenceEpisode(FaultEpisode):
    """State of the isolator beside the ``Episode`` shared with the observer.

    ``by_sensors``: what tests of single sensors have shown. ``limit``: evidence of a detection,
    nats.
    """

    change: ChangeEvidence = field(kw_only=True)
    limit: float = field(kw_only=True)
    weighed: OnsetWeighed | None = None
    by_sensors: str = ""
    shares: EvidenceGroup = field(default_factory=EvidenceGroup)

    @property
    def awaits_symbols(self) -> bool:
        """Whether nothing is known of it yet: it was taken over."""
        return self.weighed is None

    @property
    def yields_to_vibration(self) -> bool:
        """Whether no member vibrates: an alarm is then something else, as another unit's pit."""
        left = self.isolation.alive()
        return not (self.shared.opened_by_vibration or any(h.fault.vibration for h in left))

    def observe(self, record: Symbols, quadrants: Sequence[Quadrant]) -> None:
        """Signs are for those who read: what they say is in the evidence."""
        self.symbols = tuple((s.residual, s.magnitude, s.slope) for s in record.symbols)

    def weigh(self, stamp_ns: int, nats: Mapping[str, float], fits: Mapping[str, Fit]) -> None:
        """Weigh the members once more; ``nats`` of every fault that may be a member."""
        members = {}
        for name, hypothesis in self.isolation.hypotheses.items():
            if hypothesis.why_dropped not in ("", NOT_SHOWN):
                continue
            hypothesis.why_dropped = "" if name in nats else NOT_SHOWN
            if name in nats:
                members[name] = nats[name] + hypothesis.log_features
                hypothesis.fit = fits.get(name)
                hypothesis.log_likelihood = nats[name]
                hypothesis.why_kept = self._words(nats[name], name in fits)
        if not members:
            return
        self.shares.take(members, self.change.told)
        for name in members:
            hypothesis = self.isolation.hypotheses[name]
            hypothesis.probability = self.shares.shares.get(name, 0.0)
            if name in self.shares.dropped:
                share = self.shares.dropped[name]
                words = f"its share of the evidence fell to {share:.2g}"
                check = ConsistencyCheck(
                    stamp_ns, "evidence", f"{members[name]:.1f}", "", False, words
                )
                hypothesis.add(check)

    def _words(self, nats: float, is_modelled: bool) -> str:
        """What speaks for a member."""
        words = f"{nats:.1f} nats over no fault" if is_modelled else ""
        return "; ".join(filter(None, (self.by_sensors, words)))
