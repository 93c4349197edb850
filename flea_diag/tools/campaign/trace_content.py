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

"""What the file of a run's trace must hold: every part that the drawing of the run uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from flea_diag.fields.values import within

Time = Annotated[float, within(0.0, 1e9)]
"""s."""


@dataclass(frozen=True)
class TraceSignal:
    """Extremes of one signal in stretches of equal length; None where it has no value."""

    low: tuple[float | None, ...]
    high: tuple[float | None, ...]
    unit: str
    stretch_s: Time

    def __post_init__(self) -> None:
        """Both extremes are known, or none."""
        if [low is None for low in self.low] != [high is None for high in self.high]:
            raise ValueError("low and high must have values at the same places")


@dataclass(frozen=True)
class TraceGroup:
    """The ambiguity group from one moment on; ``features`` are names and the number available."""

    at_s: float
    outcome: str
    episode: int
    members: tuple[tuple[str, float | None], ...]
    dropped: Mapping[str, str]
    words: str
    features: tuple[tuple[str, ...], int]


@dataclass(frozen=True)
class TraceFeature:
    """One vibration feature that was requested."""

    asked_s: float | None
    name: str
    symbol: str
    unit: str
    reason: str
    value: float | None
    low: float | None
    high: float | None
    cost_ms: float | None


@dataclass(frozen=True)
class TraceContent:
    """The whole file."""

    traces: Mapping[str, TraceSignal]
    symbols: tuple[tuple[float, tuple[tuple[str, str, str], ...]], ...]
    groups: tuple[TraceGroup, ...]
    features: tuple[TraceFeature, ...]
    truth: tuple[tuple[str, float], ...]
    duration_s: Time
