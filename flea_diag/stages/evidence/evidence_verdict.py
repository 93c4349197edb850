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

"""The verdict of an episode by the evidence: members and dropped faults, each with its why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flea_diag.core.evidence.fault_evidence import OnsetWeighed
from flea_diag.core.evidence.goodness import contradicted
from flea_diag.core.faults.fault import Fault
from flea_diag.core.faults.response import to_do
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.stages.evidence.evidence_group import EvidenceGroup
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Candidate, Outcome


@dataclass(frozen=True, eq=False)
class VerdictKnowledge:
    """What a verdict says beside the evidence; ``models`` in the order of the hypotheses."""

    models: tuple[FaultModel, ...]
    relations: tuple[str, ...]
    faults: Mapping[str, Fault]
    calibration_sha256: str
    stated_per_hour: float
    supported_per_hour: float
    shows_from: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class OpenedBy:
    """An episode: its number, when it was detected, by what, and the limit in nats."""

    number: int
    detected_ns: int
    words: str
    limit: float


class EvidenceVerdict:
    """Verdicts of one stand."""

    def __init__(self, knowledge: VerdictKnowledge) -> None:
        self._k = knowledge

    def without_episode(self, stamp_ns: int, outcome: Outcome, words: str) -> AmbiguityGroup:
        """What is said while no episode is open."""
        return self._group(stamp_ns, outcome, words, (), (), OpenedBy(0, NEVER_NS, "", 0.0))

    def decided(
        self, opened: OpenedBy, group: EvidenceGroup, weighed: OnsetWeighed, by_sensors: str
    ) -> tuple[Outcome, str]:
        """Outcome and its words; ``by_sensors``: what tests of single sensors have shown."""
        names = ", ".join(group.shares)
        why = "" if by_sensors else self._unexplained(group, weighed, opened.limit)
        if why:
            return Outcome.UNEXPLAINED, f"none of {names} explains the deviation: {why}"
        if len(group.shares) == 1:
            return Outcome.ISOLATED, f"the fault is {names}"
        return Outcome.INDISTINGUISHABLE, f"one of {names}"

    def of_group(
        self, stamp_ns: int, decided: tuple[Outcome, str], opened: OpenedBy, group: EvidenceGroup,
        weighed: OnsetWeighed, by_sensors: str,
    ) -> AmbiguityGroup:  # fmt: skip
        """Members by their share."""
        members = tuple(
            self._candidate(fault, share, weighed, by_sensors)
            for fault, share in group.shares.items()
        )
        dropped = tuple(
            Candidate(fault, self._k.faults[fault].deviation, 0.0,
                      f"its share of the evidence fell to {share:.2g}")
            for fault, share in group.dropped.items()
        )  # fmt: skip
        return self._group(stamp_ns, *decided, members, dropped, opened)

    def _unexplained(self, group: EvidenceGroup, weighed: OnsetWeighed, limit: float) -> str:
        """What the most likely fault leaves, if none that is left fits."""
        words = ""
        for fault in group.shares:
            best = self._best(fault, weighed)
            if best is None:
                return ""
            of_sensor = bool(self._k.faults[fault].channel)
            found = contradicted(weighed, best, of_sensor, limit)
            if found is None:
                return ""
            relation = self._k.relations[found.relation]
            words = words or f"{relation} keeps {found.scatter:.1f} times its healthy scatter"
        return words

    def _best(self, fault: str, weighed: OnsetWeighed) -> int | None:
        """Number of the model of a fault that fits best; None: it has no model."""
        places = [k for k, model in enumerate(self._k.models) if model.fault == fault]
        return max(places, key=lambda k: float(weighed.every[k])) if places else None

    def _group(
        self, stamp_ns: int, outcome: Outcome, words: str, members: tuple[Candidate, ...],
        dropped: tuple[Candidate, ...], opened: OpenedBy,
    ) -> AmbiguityGroup:  # fmt: skip
        responses = [self._k.faults[m.fault].response for m in members if m.fault in self._k.faults]
        return AmbiguityGroup(
            stamp_ns=stamp_ns,
            outcome=outcome,
            episode=opened.number,
            step=0,
            seq=0,
            members=members,
            dropped=dropped,
            detected_stamp_ns=opened.detected_ns,
            words=words,
            calibration_sha256=self._k.calibration_sha256,
            source="replay",
            opened_by=opened.words,
            stated_false_alarms_per_hour=self._k.stated_per_hour,
            supported_false_alarms_per_hour=self._k.supported_per_hour,
            to_do=to_do(responses),
            shows_from=self._k.shows_from,
        )

    def _candidate(
        self, fault: str, share: float, weighed: OnsetWeighed, by_sensors: str
    ) -> Candidate:
        """A member with its size by the model of it that fits best."""
        best = self._best(fault, weighed)
        if best is None:
            return Candidate(fault, self._k.faults[fault].deviation, share, by_sensors)
        words = f"{weighed.every[best]:.1f} nats over no fault"
        sizes = self._k.models[best].sizes
        # The first size that is not 0: a drag may be purely viscous.
        index = next((i for i in range(len(sizes)) if weighed.size[best, i]), 0)
        size, sigma = float(weighed.size[best, index]), float(weighed.sigma[best, index])
        why = f"{by_sensors}; {words}" if by_sensors else words
        return Candidate(
            fault, self._k.faults[fault].deviation, share, why, (), size, sigma,
            sizes[index].unit if sizes else "",
        )  # fmt: skip
