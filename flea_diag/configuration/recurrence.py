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

"""What a stand knows of faults that come and go, by the law of its calibration."""

from __future__ import annotations

from functools import partial

from flea_diag.configuration.evidence import EvidenceStand
from flea_diag.core.likelihood.effect_set import motion_signals
from flea_diag.core.residuals.channel_units import UNITS
from flea_diag.core.run_law.run_windows import signal_names
from flea_diag.stages.recurrence.recurrence_knowledge import RecurrenceKnowledge


def recurrence_of(stand: EvidenceStand) -> RecurrenceKnowledge:
    """Of a stand whose calibration has a law."""
    told, law = stand.told, stand.knowledge
    known, calibration = told.effects, told.calibration
    hypotheses = law.hypotheses[0]
    faults = [told.faults[model.fault] for model in hypotheses.signatures.models]
    rows, readings = known.residuals, list(known.readings)
    load = motion_signals(rows)[1]
    # What grows from nothing cannot come and go within a second, and a reading that is dead for a
    # while has dropped out: its own test says so.
    usable = tuple(not fault.incipient and fault.mode != "dead" for fault in faults)
    return RecurrenceKnowledge(
        hypotheses,
        # A push against a stop is in no healthy recording.
        partial(law.columns, acting=hypotheses.acting(usable), silent_at_ends=True),
        tuple((f.name, readings.index(f.channel) if f.channel in readings else -1) for f in faults),
        usable,
        tuple(name not in rows.predictions for name in law.relations),
        rows.position if rows.position in known.names else "",
        {**UNITS, **rows.units}[rows.position],
        signal_names(known).index(load),
        0.5 * calibration.counts.kernel * calibration.period_s,
        law.scans,
    )
