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
    SizeTrend,
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
    SizeTrend,
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
