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

"""Nominal recordings in which a sensor died, known by what all others show of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flea_diag.core.calibration.calibration import Calibration, NominalRun
    from flea_diag.core.calibration.innovation_learning import Array
    from flea_diag.core.residuals.relation_set import RelationSet
    from flea_diag.core.residuals.residual_rows import ResidualSet


def dead_sensors(
    runs: Sequence[NominalRun], calibration: Calibration, relations: RelationSet
) -> dict[str, str]:
    """Recordings in which a sensor stands still, or is not read, as in none of the others: why."""
    from flea_diag.core.calibration.promise import LEAST_RECORDINGS
    from flea_diag.core.sensors.held_alone import held_alone
    from flea_diag.core.sensors.missing_alone import missing_alone

    if len(runs) <= LEAST_RECORDINGS:
        return {}
    sensors, rate = relations.residuals.sensors, calibration.false_alarms_per_hour
    given = readings(runs, relations.residuals)
    found = held_alone(given, calibration.sensors, sensors, rate, calibration.period_s)
    missing = missing_alone(given, calibration.period_s)
    odd = {
        number: f"{channel} repeats one reading for longer than in any other recording"
        for number, channel in found
    }
    for number, channel, gap_s, others_s in missing:
        odd[number] = (
            f"{channel} has no reading for {gap_s:.1f} s, for at most {others_s:.1f} s "
            "in any other recording"
        )
    return {runs[number].name: why for number, why in odd.items()}


def readings(runs: Sequence[NominalRun], known: ResidualSet) -> list[dict[str, Array]]:
    """Readings of each channel, recording by recording."""
    return [{name: run.rows[:, k] for name, k in known.index.items()} for run in runs]
