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

"""The law of the recordings of a calibration: learned, and what it can see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flea_diag.configuration.description import described
from flea_diag.core.calibration.calibration import Calibration
from flea_diag.core.evidence.friction import Friction
from flea_diag.core.run_law.fault_columns import FaultColumns, fault_columns
from flea_diag.core.run_law.law_columns import LawColumns, dry_friction, law_columns
from flea_diag.core.run_law.law_learning import LawFit, acting, learn_law
from flea_diag.core.run_law.run_law import RunLaw
from flea_diag.core.run_law.run_windows import (
    WINDOW_S,
    RunWindows,
    signal_names,
    usual_speed,
)
from flea_diag.core.run_law.visible_sizes import limit_nats, visible_sizes
from flea_diag.tools.calibrate.law_windows import WindowItem, WindowWork, travel_of
from flea_diag.tools.calibrate.law_words import reason_of
from flea_diag.tools.calibrate.limit_sizes import with_limits
from flea_diag.tools.calibrate.nominal_recording import NominalRecording
from flea_diag.tools.calibrate.shared_work import ALONE, Sharing
from flea_diag.tools.terminal import progress

DROP_NATS = 3.5
"""As ``drop_nats`` of the isolator: what a fault must be ahead of another one by."""


@dataclass(frozen=True, eq=False)
class LawDesign:
    """What a law of this calibration is made of: columns of healthy differences and of faults."""

    work: WindowWork
    columns: LawColumns
    faults: FaultColumns

    @classmethod
    def of(
        cls, calibration: Calibration, actuator: str, faults: str,
        recordings: Sequence[NominalRecording],
    ) -> LawDesign:  # fmt: skip
        """From the description, the catalogue and where healthy recordings have moved."""
        work = WindowWork.of(calibration, actuator, faults)
        effects, parameters = work.effects(), calibration.parameters
        moved = (recording.run.rows for recording in recordings)
        work = replace(work, travel=travel_of(moved, effects.residuals))
        differences = effects.differences
        tolerance = dict(zip(differences, calibration.differences(differences), strict=True))
        free = described(actuator).free_per_run
        columns = law_columns(effects, parameters, tolerance, work.relations, free)
        models, signals = effects.bound(parameters), signal_names(effects)
        predictions = effects.residuals.predictions
        found = fault_columns(models, work.relations, signals, predictions)
        return cls(work, columns, found)

    def windows(
        self, recordings: Sequence[NominalRecording], sharing: Sharing = ALONE
    ) -> list[RunWindows]:
        """Recordings as the law sees them."""
        items = [WindowItem(recording.run, recording.serial) for recording in recordings]
        return list(sharing.over(self.work.windows, items, "windows"))

    def learned(self, runs: Sequence[RunWindows]) -> LawFit:
        """The law of these recordings."""
        return learn_law(runs, self.columns, self.faults, self.work.sharing(), progress)

    def with_sizes(
        self, fit: LawFit, calibration: Calibration, recordings: Sequence[NominalRecording],
        sharing: Sharing = ALONE,
    ) -> RunLaw:  # fmt: skip
        """The law with the sizes of faults that it and the limits of the calibration can see."""
        limit = limit_nats(calibration.false_alarms_per_hour, len(self.faults))
        effects, relations = self.work.effects(), self.work.relations
        usual = usual_speed(fit.sound, effects, relations)
        dry = dry_friction(effects, calibration.parameters, relations)
        friction = Friction.of(dry, effects, usual)
        seen = visible_sizes(
            fit.law, fit.columns, self.faults, fit.sound, limit, DROP_NATS, friction.loudness
        )
        both = with_limits(seen, calibration, self.work, self.faults, recordings, sharing)
        return replace(fit.law, visible=tuple(both), usual_speed=usual, travel=self.work.travel)


TOO_MANY = (
    "contradict the others, too many to tell which are the healthy ones: all are kept. Of two "
    "units, record each under its serial number; of a load of its own, record more; of one unit "
    "and load, the description lacks something of these motions"
)
OF_MOTION = (
    "contradict the others alike in most units, so the description lacks something of their "
    "motion: they are kept, and what differs is known less well. Describe it, or calibrate "
    "without that motion"
)
LEAST_WINDOWS = 15
"""3 s: less says nothing of what a recording differs by."""


def _unfit(design: LawDesign, runs: Sequence[RunWindows]) -> str:
    """Why no law can be learned of these recordings; empty: one can."""
    formed = [np.isfinite(run.values).any(axis=1).sum() for run in runs]
    if max(formed, default=0) < LEAST_WINDOWS:
        seconds = max(formed, default=0) * WINDOW_S
        return (
            f"the longest recording has its relations for {seconds:.1f} s, at least "
            f"{LEAST_WINDOWS * WINDOW_S:.0f} s of motion are needed: record longer"
        )
    if not acting(runs, design.columns) or not len(design.faults):
        return "nothing that healthy units differ by shows in these recordings: record motion"
    return ""


@dataclass(frozen=True, eq=False)
class LawOfRecordings:
    """What the recordings of a calibration, taken together, say of each other.

    ``unlike``: recording -> why it is not as the others, and what to do.
    ``noisy``: what is left out of single recordings, in words.
    """

    design: LawDesign | None = None
    fit: LawFit | None = None
    unlike: Mapping[str, str] = field(default_factory=dict)
    noisy: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, calibration: Calibration, actuator: str | Path, faults: str | Path | None,
        recordings: Sequence[NominalRecording], sharing: Sharing,
    ) -> LawOfRecordings:  # fmt: skip
        """Learn it; nothing without a catalogue, or without a relation that a law could be of."""
        if faults is None:
            return cls()
        design = LawDesign.of(calibration, str(actuator), str(faults), recordings)
        runs = design.windows(recordings, sharing)
        runs = [run for run in runs if len(run) >= LEAST_WINDOWS // 5]
        why = _unfit(design, runs)
        if why:
            return cls(noisy=(f"no law of healthy recordings: {why}",))
        fit = design.learned(runs)
        relations = design.work.effects().relations
        names = [run.name for run in runs]
        odd = {names[row.place]: reason_of(row, relations) for row in fit.unsound}
        noisy = [f"{names[row.place]}: {reason_of(row, relations)}" for row in fit.noisy]
        for rows, words in ((fit.contradicting, TOO_MANY), (fit.of_motion, OF_MOTION)):
            if rows:
                first = f"{names[rows[0].place]}: {reason_of(rows[0], relations)}"
                noisy.append(f"{len(rows)} of {len(runs)} recordings {words}. The first is {first}")
        return cls(design, fit, odd, tuple(noisy))

    def seeing(
        self, calibration: Calibration, recordings: Sequence[NominalRecording], sharing: Sharing
    ) -> RunLaw | None:
        """The law with the sizes of faults that show."""
        if self.design is None or self.fit is None:
            return None
        law = self.design.with_sizes(self.fit, calibration, recordings, sharing)
        return replace(law, unlike=tuple(self.unlike.items()))
