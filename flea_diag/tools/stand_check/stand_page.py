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

"""What is on the page of ``flea stand check``; ``page_text`` writes it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import Stand
from flea_diag.core.calibration.promise import FALSE_ALARMS_PER_HOUR, FalseAlarmPromise
from flea_diag.core.faults.fault import Fault, of_sensors
from flea_diag.core.isolation.detectability import tested_alone
from flea_diag.core.likelihood.size_bound import SizeBound
from flea_diag.core.machine_modes import never_seen, never_seen_words
from flea_diag.core.residuals.residual_rows import ResidualSet
from flea_diag.core.run_law.run_law import VisibleSize
from flea_diag.tools.recordings.channel_lag import ChannelLag, channel_lags
from flea_diag.tools.stand_check.channel_check import ChannelCheck, channel_checks
from flea_diag.tools.stand_check.fault_sizes import FaultSizes
from flea_diag.tools.stand_check.recorded_motion import RecordedMotion

WHOLE = ("dead", "noise", "dropout")
"""Modes of a sensor fault that have no size to be found from."""
WORTH = 2.0
"""Factor by which one more sensor lowers the size of a fault, for it to be named."""


@dataclass(frozen=True)
class OneMoreSensor:
    """A sensor of the description that is not recorded, and the faults that it would show."""

    channel: str
    brings: tuple[str, ...]


@dataclass(frozen=True)
class StandPage:
    """All that recordings say of a stand.

    ``bounds`` are those of faults with a size; ``alone`` are faults of sensors that tests of their
    own readings show, ``unseen`` those that nothing here shows, and why.
    """

    stand: str
    recordings: int
    seconds: float
    period_s: float
    calibrated: bool
    channels: tuple[ChannelCheck, ...]
    relations: tuple[str, ...]
    bounds: tuple[SizeBound, ...]
    alone: tuple[str, ...]
    unseen: dict[str, str]
    sensors: tuple[OneMoreSensor, ...]
    promise: FalseAlarmPromise
    problems: tuple[str, ...]
    visible: tuple[VisibleSize, ...] = ()
    """What the calibration of the stand sees; empty where it holds no law of its recordings."""
    modes: tuple[str, ...] = ()
    """Words on each mode of the machine that no recording shows."""
    lags: tuple[ChannelLag, ...] = ()
    """How long channels come after others, where the motion shows it."""

    @property
    def missing_hours(self) -> float:
        """Of healthy running, for the stated rate of false alarms."""
        return max(self.promise.needed_hours - self.promise.hours, 0.0)

    @property
    def missing_recordings(self) -> int:
        """As many as these are long on average."""
        return math.ceil(self.missing_hours * 3600.0 / (self.seconds / self.recordings))


def stand_page(stand: Stand, motions: Sequence[RecordedMotion]) -> StandPage:
    """Everything on the page.

    Raises
    ------
    ConfigurationError
        A file of the stand is refused.
    """
    every = tuple(dict.fromkeys(row.name for motion in motions for row in motion.channels))
    whole = FaultSizes(stand, every, tuple(motions))
    wanted = whole.relations.residuals.channels
    checks = channel_checks(motions, wanted, whole.relations)
    usable = tuple(row.name for row in checks if not row.problem)
    sizes = replace(whole, channels=usable)
    known = of_sensors(faults_of(stand.actuator, stand.faults), usable)
    sized = {name for name, fault in known.items() if fault.mode not in WHOLE}
    bounds = sizes.bounds(sized)
    symptoms = sizes.relations.residuals.symptoms
    alone = tuple(
        name for name, row in known.items() if row.channel and tested_alone(row, symptoms)
    )
    lacking = [name for name in wanted if name not in usable]
    seconds = sum(motion.seconds for motion in motions)
    promise = FalseAlarmPromise(FALSE_ALARMS_PER_HOUR, len(motions), seconds / 3600.0)
    if sizes.calibration is not None:
        promise = sizes.calibration.promise
    law = sizes.calibration.law if sizes.calibration is not None else None
    return StandPage(
        stand.name,
        len(motions),
        seconds,
        motions[0].period_s,
        sizes.calibration is not None,
        checks,
        (*sizes.relations.names, *(row.name for row in sizes.relations.predictions)),
        tuple(row for row in bounds if math.isfinite(row.detected_from)),
        alone,
        dict(_unseen(known, bounds, alone)),
        tuple(_brought(sizes, sized, bounds, lacking)),
        promise,
        tuple(_problems(checks)),
        law.visible if law is not None else (),
        tuple(_modes(whole.relations.residuals, motions)),
        tuple(_lags(motions, [row for row in checks if row.name in usable])),
    )


def _modes(known: ResidualSet, motions: Sequence[RecordedMotion]) -> Iterator[str]:
    told = [motion.in_order(known.channels) for motion in motions]
    for mode in never_seen(known.modes, told):
        yield never_seen_words(mode, known.channels[mode.channel])


def _lags(
    motions: Sequence[RecordedMotion], usable: Sequence[ChannelCheck]
) -> Sequence[ChannelLag]:
    units = {row.name: row.unit for row in usable}
    gap = np.full((1, len(units)), np.nan)
    rows = [part for motion in motions for part in (motion.in_order(tuple(units)), gap)]
    return channel_lags(units, np.concatenate(rows), motions[0].period_s)


def _unseen(
    known: Mapping[str, Fault], bounds: Sequence[SizeBound], alone: Collection[str]
) -> Iterator[tuple[str, str]]:
    seen = {row.fault for row in bounds if math.isfinite(row.detected_from)}
    moved = {row.fault for row in bounds}
    for name, fault in known.items():
        if name in seen or name in alone:
            continue
        if name in moved:
            yield name, f"not in this motion at any size; excitation: {fault.excitation}"
        elif fault.vibration and not fault.effects:
            yield name, "by accelerometers alone"
        else:
            others = ", but by accelerometers" if fault.vibration else ""
            where = f"in no relation of these channels{others}"
            yield name, f"{where}; excitation: {fault.excitation}"


def _brought(
    sizes: FaultSizes,
    faults: Collection[str],
    bounds: Sequence[SizeBound],
    lacking: Sequence[str],
) -> Iterator[OneMoreSensor]:
    """What each sensor of the description would bring that is not recorded, or not usable."""
    for channel in lacking:
        found = sizes.with_sensor(channel, faults)
        if found is not None:
            yield OneMoreSensor(channel, tuple(dict.fromkeys(_gains(bounds, found))))


def _gains(before: Sequence[SizeBound], after: Sequence[SizeBound]) -> Iterator[str]:
    had = {(row.fault, row.size.name): row for row in before}
    for row in after:
        was = had.get((row.fault, row.size.name))
        if not math.isfinite(row.detected_from):
            continue
        size = f"{row.size.name} {sized(row.detected_from, row)}"
        if was is None or math.isinf(was.detected_from):
            if row.fault not in {old.fault for old in before if math.isfinite(old.detected_from)}:
                yield f"detects {row.fault} from {size} on"
        elif was.group and len(row.group) < len(was.group):
            gone = [name for name in was.group if name not in row.group]
            yield f"isolates {row.fault} from {', '.join(gone)}"
        elif row.detected_from * WORTH < was.detected_from:
            yield f"detects {row.fault} from {size} on, not {sized(was.detected_from, was)}"


def _problems(checks: Sequence[ChannelCheck]) -> Iterator[str]:
    for row in checks:
        if row.problem and row.relations:
            yield f"{row.name}: {row.problem}"


def sized(value: float, row: SizeBound) -> str:
    """A size of a fault with its unit."""
    return f"{float(f'{value:.2g}'):g}" + ("" if row.size.unit == "1" else f" {row.size.unit}")
