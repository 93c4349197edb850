"""Record types that come and go through the bus of a stage's node."""

from __future__ import annotations

from dataclasses import dataclass

from flea_diag.wire.records import (
    AmbiguityGroup,
    ChannelTable,
    DataQuality,
    Detection,
    FeatureRequest,
    FeatureValue,
    Hypotheses,
    Remark,
    Residual,
    Scan,
    Symbols,
    VerdictNumbers,
    VibrationBlock,
)

JUDGEMENTS = (
    DataQuality,
    Residual,
    Detection,
    Symbols,
    FeatureRequest,
    FeatureValue,
    Hypotheses,
    AmbiguityGroup,
    VerdictNumbers,
)

SOURCES: tuple[type, ...] = (ChannelTable, VibrationBlock, Scan, Remark)
"""Records that a stand and its operators publish; all other records follow from them."""


@dataclass(frozen=True)
class StagePorts:
    """Record types that a node subscribes to and publishes, declared before it runs.

    Records that composed stages exchange, and a stage's own verdict, are published for operators
    and the recorder, and must not be read back from the bus: they are not subscribed to.
    """

    subscribes: tuple[type, ...]
    publishes: tuple[type, ...]

    def reads(self, record_type: type) -> bool:
        """Whether a record that the stage consumes comes from the bus."""
        return record_type in self.subscribes
