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

"""One failure to analyse, and what became of it: a line of the FMEA."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flea_diag.tools.fmea.motion_effect import MotionEffect
from flea_diag.tools.recordings.injection import ChannelFault

ISOLATED, GROUPED, NEAREST = "isolated", "in the group", "nearest named"
UNEXPLAINED = "unexplained"
MISNAMED, EARLY, MISSED, NOT_RUN = "another named", "alarm before it", "not detected", "not run"
DETECTION: Mapping[str, int] = {
    ISOLATED: 1, GROUPED: 3, NEAREST: 4, UNEXPLAINED: 5, MISNAMED: 8, EARLY: 9, MISSED: 10,
}  # fmt: skip
"""What became of it -> rating of the detection in the form of IEC 60812, 1 best, 10 worst."""

MOST_NAMED = 6
"""Largest group that says anything of the failure."""


@dataclass(frozen=True)
class Failure:
    """One row of the catalogue at one size.

    Parameters
    ----------
    name
        Of its bag.
    nearest
        Faults of the catalogue that it may be named as, where the catalogue has no row for it.
    scenario
        Of its simulation; empty: there is none.
    recording, injection
        A healthy bag, and what is injected into it.
    remark
        How it is found, or why it was not run.
    """

    name: str
    fault: str
    title: str
    component: str
    size: float | None = None
    size_unit: str = ""
    nearest: tuple[str, ...] = ()
    scenario: Mapping[str, Any] = field(default_factory=dict)
    recording: str = ""
    injection: ChannelFault | None = None
    remark: str = ""
    of_sensor: bool = False

    def __str__(self) -> str:
        return self.name

    @property
    def runs(self) -> bool:
        """Whether there is anything to run."""
        return bool(self.scenario or self.injection)


@dataclass(frozen=True)
class AnalysedFailure:
    """One line of the FMEA; None is unknown.

    ``severity`` and ``occurrence`` are the user's ratings, ``detection`` follows from ``became``.
    """

    failure: Failure
    became: str
    effect: MotionEffect | None = None
    outcome: str = ""
    group: tuple[str, ...] = ()
    detected_by: str = ""
    delay_s: float | None = None
    to_do: str = ""
    remark: str = ""
    bag: str = ""
    broken: str = ""
    severity: int | None = None
    occurrence: int | None = None

    @property
    def detection(self) -> int | None:
        """Rating of the detection."""
        return DETECTION.get(self.became)

    @property
    def risk(self) -> int | None:
        """Risk priority number, where all three ratings are known."""
        if self.severity is None or self.occurrence is None or self.detection is None:
            return None
        return self.severity * self.occurrence * self.detection

    @property
    def rank(self) -> tuple[int, int, str, str]:
        """The highest risk first, then what is found worst."""
        return -(self.risk or 0), -(self.detection or 0), self.failure.component, self.failure.name


def became(
    fault: Failure, detected: bool, alarms: bool, outcome: str, group: tuple[str, ...]
) -> str:
    """What became of a failure: one of ``DETECTION``.

    Parameters
    ----------
    detected
        Whether the last episode began after the onset.
    alarms
        Whether there was any episode.
    """
    if not detected:
        return EARLY if alarms else MISSED
    if outcome == "UNEXPLAINED" or len(group) > MOST_NAMED:
        return UNEXPLAINED
    if fault.fault in group:
        return ISOLATED if len(group) == 1 else GROUPED
    return NEAREST if set(group) <= set(fault.nearest) else MISNAMED
