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


"""What a named fault hides: faults that no relation would show beside it."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.isolation.detectability import tested_alone
from flea_diag.core.isolation.pair_models import PairModels, by_fault
from flea_diag.core.likelihood.fault_models import FaultModel, moved_by
from flea_diag.stages.isolator.parameters import Knowledge


class Masking:
    """Says which faults a dead reading hides; ``models`` are those of the stand."""

    def __init__(self, knowledge: Knowledge, models: Sequence[FaultModel]) -> None:
        self._faults, self._symptoms = knowledge.faults, knowledge.symptoms
        self._models = by_fault(models)
        self._pairs = PairModels(self._models, self._models, knowledge.deaths(self._models))
        self._needing = {
            name: knowledge.effects.needing(fault.channel)
            for name, fault in knowledge.faults.items()
            if fault.mode == "dead"
        }

    def hidden(
        self, pairs: Sequence[tuple[str, ...]], without_value: Collection[str] = ()
    ) -> tuple[tuple[str, str], ...]:
        """Faults hidden by one that is in each of these sets of faults, each with the reason.

        A reading that is held is withheld, and relations that need it are ``without_value``.
        """
        named = [name for name in self._needing if pairs and all(name in pair for pair in pairs)]
        return tuple(
            (fault, f"hidden by {name}: each relation that shows it needs this reading")
            for name in named
            for fault in self._models
            if not any(fault in pair for pair in pairs)
            and not tested_alone(self._faults[fault], self._symptoms)
            and self._shown(fault, name) <= self._needing[name].intersection(without_value)
        )

    def _shown(self, fault: str, dead: str) -> frozenset[str]:
        """Relations that would show a fault beside a dead reading, if they had a value."""
        return moved_by(self._pairs.beside(fault, dead))
