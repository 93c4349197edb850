"""Why several faults are left: by design of the sensor set, or by this evidence alone."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from flea_diag.core.choice.feature_choice import FeatureChooser
from flea_diag.core.choice.feature_table import FaultFeatureTable
from flea_diag.core.isolation.isolation import Hypothesis
from flea_diag.core.likelihood.fault_models import FaultModel
from flea_diag.core.likelihood.isolability import computable, isolable, required_channels
from flea_diag.stages.isolator.fault_episode import FaultEpisode
from flea_diag.stages.isolator.stand_status import StandStatus
from flea_diag.wire.records import BY_DESIGN

BY_EVIDENCE = "not split by this evidence"


class Ambiguity:
    """Says what would split a group of faults.

    Parameters
    ----------
    models, quantified : fault models of the stand, and the residuals that they explain
    """

    def __init__(
        self,
        table: FaultFeatureTable,
        models: Sequence[FaultModel],
        quantified: Collection[str],
    ) -> None:
        self._models = models
        self._quantified = tuple(quantified)
        self._chooser = FeatureChooser(table, "information")

    def reason(self, stand: StandStatus, episode: FaultEpisode, alive: list[Hypothesis]) -> str:
        """Faults that no residual isolates, no further scan will ever tell apart."""
        names = [h.name for h in alive]
        if episode.query.computed:
            return BY_EVIDENCE
        if not isolable(self._models, names, self._quantified):
            return self._vibration(stand, episode, alive)
        left = computable(self._quantified, stand.bad)
        if len(left) < len(self._quantified) and not isolable(self._models, names, left):
            lost = ", ".join(channel for channel in stand.bad if self._is_required(channel))
            return f"cannot be split without {lost}, {BY_DESIGN}; sound readings of it would"
        return BY_EVIDENCE

    def _vibration(self, stand: StandStatus, episode: FaultEpisode, alive: list[Hypothesis]) -> str:
        """Whether vibration would isolate what residuals cannot."""
        if not stand.axes and any(h.fault.vibration for h in alive):
            return f"cannot be split by this sensor set, {BY_DESIGN}; accelerometers would"
        if not stand.axes or self._chooser.next(episode.group()) is None:
            return f"cannot be split by this sensor set, {BY_DESIGN}"
        return "not split yet: features of vibration would, on a usable second of motion"

    def _is_required(self, channel: str) -> bool:
        """Whether a residual of the fault models needs this channel."""
        return any(channel in required_channels(residual) for residual in self._quantified)
