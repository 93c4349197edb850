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

"""Why a group is not isolated further: by design of the sensor set, or for lack of evidence."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.isolation.hypothesis import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.isolability import computable, isolable
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.wire.records import BY_DESIGN

VIBRATION_PENDING = "not isolated yet; vibration features need a valid window in motion"
BY_EVIDENCE = "not isolated by the evidence so far"


class Ambiguity:
    """Says what would isolate the faults of a group.

    Parameters
    ----------
    models, quantified : fault models of the stand, and the residuals that they explain
    """

    def __init__(
        self,
        table: FaultFeatureTable,
        models: Sequence[FaultModel],
        quantified: Collection[str],
        residuals: ResidualSet,
    ) -> None:
        self._models, self._residuals = models, residuals
        self._quantified = tuple(quantified)
        self._chooser = FeatureChooser(table, "information")
        self._known: dict[tuple[tuple[str, ...], tuple[str, ...]], bool] = {}

    def reason(self, stand: StandStatus, episode: FaultEpisode, alive: list[Hypothesis]) -> str:
        """Why the faults left are not isolated; where possible, what would isolate them."""
        names = [h.name for h in alive]
        if episode.query.computed:
            return BY_EVIDENCE
        if not self._isolable(names, self._quantified):
            return self._vibration(stand, episode, alive)
        left = computable(self._residuals, self._quantified, stand.bad)
        if len(left) < len(self._quantified) and not self._isolable(names, left):
            lost = ", ".join(channel for channel in stand.bad if self._is_required(channel))
            return f"not isolable without {lost}, {BY_DESIGN}; valid readings would isolate them"
        return BY_EVIDENCE

    def _isolable(self, faults: Sequence[str], residuals: tuple[str, ...]) -> bool:
        """``isolable``, remembered: it depends on nothing that is measured."""
        key = tuple(faults), residuals
        if key not in self._known:
            self._known[key] = isolable(self._models, faults, residuals)
        return self._known[key]

    def _vibration(self, stand: StandStatus, episode: FaultEpisode, alive: list[Hypothesis]) -> str:
        """The same for faults that no residual isolates: whether vibration would."""
        if not stand.axes and any(h.fault.vibration for h in alive):
            return (
                f"not isolable with these sensors, {BY_DESIGN}; accelerometers would isolate them"
            )
        if not stand.axes or self._chooser.next(episode.group()) is None:
            return f"not isolable with these sensors, {BY_DESIGN}"
        return VIBRATION_PENDING

    def _is_required(self, channel: str) -> bool:
        """Whether a residual of the fault models needs this channel."""
        return any(channel in self._residuals.named[name].needs for name in self._quantified)
