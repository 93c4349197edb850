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

"""What each channel of a stand gives in its recordings, and whether that is usable."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from flea_diag.core.flag_runs import longest_run
from flea_diag.core.residuals.channel_units import unit_refusal
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.tools.recordings.source_checks import MOST_OUTSIDE
from flea_diag.tools.stand_check.recorded_motion import RecordedMotion
from flea_diag.wire.records import ChannelInfo

Array = npt.NDArray[np.float64]
MOST_MISSING = 0.05
"""Share of the scans without a reading above which a channel is not usable."""
THIRD_DIFFERENCE = math.sqrt(20.0)
NORMAL_MEDIAN = 0.6745


@dataclass(frozen=True)
class ChannelCheck:
    """One channel over all recordings; ``problem`` is empty where it is usable.

    ``noise`` is the standard deviation of what changes from scan to scan beyond motion,
    ``longest_gap_s`` the longest time without a reading.
    """

    name: str
    unit: str
    rate_hz: float
    lowest: float
    highest: float
    noise: float
    missing: float
    longest_gap_s: float
    relations: tuple[str, ...]
    problem: str = ""


def channel_checks(
    motions: Sequence[RecordedMotion], described: Sequence[str], relations: RelationSet
) -> tuple[ChannelCheck, ...]:
    """Every channel of the recordings, then those of the description that they lack."""
    infos = {row.name: row for motion in motions for row in motion.channels}
    found = [_check(info, motions, relations) for info in infos.values()]
    lacking = [name for name in described if name not in infos]
    nothing = (math.nan,) * 4
    return (
        *found,
        *(ChannelCheck(name, "", *nothing, 1.0, math.nan, (), "not recorded") for name in lacking),
    )


def _check(
    info: ChannelInfo, motions: Sequence[RecordedMotion], relations: RelationSet
) -> ChannelCheck:
    columns = [motion.in_order((info.name,))[:, 0] for motion in motions]
    everything = np.concatenate(columns)
    read = everything[np.isfinite(everything)]
    missing = 1.0 - len(read) / len(everything)
    gap_s = max(
        longest_run(np.isnan(column)) * motion.period_s
        for column, motion in zip(columns, motions, strict=True)
    )
    return ChannelCheck(
        info.name,
        info.unit,
        info.rate_hz,
        float(read.min()) if len(read) else math.nan,
        float(read.max()) if len(read) else math.nan,
        _noise(columns),
        missing,
        gap_s,
        tuple(_read_by(info.name, relations)),
        unit_refusal(info.name, info.unit, relations.units_of)
        or _problem(info, read, missing, gap_s, _tells_mode(info.name, relations)),
    )


def _tells_mode(channel: str, relations: RelationSet) -> bool:
    """Whether a mode of the machine is told by it, which may be the same all the time."""
    known = relations.residuals
    return any(known.channel(channel) == mode.channel for mode in known.modes)


def _problem(
    info: ChannelInfo, read: Array, missing: float, gap_s: float, may_rest: bool = False
) -> str:
    """Why a channel is not usable, in words."""
    if not len(read):
        return "no reading: is its sensor connected?"
    if missing > MOST_MISSING:
        return (
            f"{missing:.0%} of the scans have no reading, at most {MOST_MISSING:.0%} may lack one; "
            f"the longest gap is {gap_s:.2g} s"
        )
    if float(read.min()) == float(read.max()) and not may_rest:
        return f"always {read[0]:g} {info.unit}: dead, or recorded at rest"
    outside = float(np.mean((read < info.minimum) | (read > info.maximum)))
    if outside > MOST_OUTSIDE:
        return (
            f"{outside:.0%} of its readings are outside its range of {info.minimum:g} to "
            f"{info.maximum:g} {info.unit}: correct its unit, scale or range"
        )
    return ""


def _read_by(channel: str, relations: RelationSet) -> Iterator[str]:
    """Residuals that need a channel, those of normalised relations once."""
    known = relations.residuals
    formed = (*relations.names, *(row.name for row in relations.predictions))
    for name in dict.fromkeys(formed):
        row = known.named.get(name)
        if row is None:
            continue
        motion = known.encoder or known.position if "speed" in row.needs else ""
        if channel in row.needs or channel == motion:
            yield name


def _noise(columns: Sequence[Array]) -> float:
    """Robust standard deviation, by third differences, which are blind to motion."""
    third = np.concatenate(
        [c[3:] - 3.0 * c[2:-1] + 3.0 * c[1:-2] - c[:-3] for c in columns if len(c) > 3]
    )
    third = third[np.isfinite(third)]
    if not len(third):
        return math.nan
    return float(np.median(np.abs(third))) / NORMAL_MEDIAN / THIRD_DIFFERENCE
