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

"""The conditions that void relations, one row each.

While a condition holds, the relations that it voids have no value, whatever the readings; tests of
single sensors and all other relations go on. Which relations these are follows from the bond graph
and from what the relations read, not from their names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flea_diag.core.conditions.contact import LONGEST_S, TAKES_BACK_S
from flea_diag.core.frozen import Frozen
from flea_diag.core.residuals.relation_set import RelationSet
from flea_diag.core.residuals.residual import STALL
from flea_diag.core.residuals.residual_rows import SPEED

Columns = list[int]


@dataclass(frozen=True)
class Condition(Frozen):
    """One row.

    ``evidence`` says in words what shows the condition, ``judged_by`` which module of the package
    judges it (empty: none, for it voids nothing here), ``columns`` which residuals it voids,
    ``longest_s`` for how long at most (None: for as long as the evidence stands), and
    ``takes_back_s`` within which time of an alarm its evidence takes the alarm back, where all that
    the alarm rests on is void.
    """

    name: str
    evidence: str
    judged_by: str
    columns: Callable[[RelationSet], Columns]
    longest_s: float | None = None
    takes_back_s: float = 0.0


def _with_reaction(known: RelationSet) -> Columns:
    """Balances that hold the reaction of a stop, and what friction heats: running into it does."""
    rows = known.residuals
    return [*rows.of_relations(known.stop.reactions), *rows.columns(known.rubbed)]


def _reading(*channels: str) -> Callable[[RelationSet], Columns]:
    """Residuals that need all of these channels."""
    return lambda known: known.residuals.needing(*channels)


def _of_one_speed(known: RelationSet) -> Columns:
    """Differences between two readings of a speed."""
    return known.residuals.of_relations(known.residuals.of_one_speed)


def _settling(known: RelationSet) -> Columns:
    """Residuals that the description gives time to settle."""
    rows = known.residuals
    return rows.columns(row.name for row in rows.parities if row.settles_s)


def _of_modes(known: RelationSet) -> Columns:
    """Residuals that have no value in some mode of the machine, or in all others."""
    modes = known.residuals.modes
    return sorted({j for mode in modes for j in (*mode.voids, *mode.only)})


def _of_relations(known: RelationSet) -> Columns:
    """All that is formed from readings: those that need the clipped one."""
    tested = range(len(known.residuals.rows))[known.residuals.sensor_columns]
    return [column for column in known.residuals.needing() if column not in tested]


def _nothing(_: RelationSet) -> Columns:
    return []


CONDITIONS: tuple[Condition, ...] = (
    Condition(
        "end_of_travel",
        "near an end that it moved to, it stands, and the balance misses a force away from the end",
        "core.conditions.end_of_travel",
        _with_reaction,
        LONGEST_S,
        TAKES_BACK_S,
    ),
    Condition(
        "clipped_reading",
        "at an end that it moved to, or as it runs away, a reading is at a limit of its range",
        "core.conditions.clipped",
        _of_relations,
        LONGEST_S,
    ),
    Condition(
        "saturated_drive",
        "the command is at a limit of its range: the drive delivers what it can, not what is asked",
        "stages.observer.condition_watch",
        _reading("commanded_voltage"),
    ),
    Condition(
        "slack_load_cell",
        "the load cell reads zero within its noise although a load is commanded",
        "",
        _reading("load_force", "commanded_load"),
    ),
    Condition(
        "untrusted_voltage",
        "current and motion contradict a voltage that no command corroborates",
        "stages.observer.voltage_trust",
        _reading("motor_voltage"),
    ),
    Condition(
        "stepped_position",
        "a position step reads as a speed, and no encoder measures it",
        "stages.observer.speed_trust",
        _reading(SPEED),
    ),
    Condition(
        "faster_than_recorded",
        "both readings of a speed are out of the range of the recordings: no sensor is at fault",
        "core.conditions.envelope_watch",
        _of_one_speed,
    ),
    Condition(
        "machine_mode",
        "a channel says that the machine is in a mode of its description, as held by its brake",
        "core.machine_modes",
        _of_modes,
    ),
    Condition(
        "settling_drive",
        "motion has just begun, ended or turned: a drive that nobody reads settles for a while",
        "core.residuals.settling",
        _settling,
    ),
    Condition(
        "standing_against_push",
        f"it stands under a push of {STALL:g} dry frictions: the relations hold, but the direction "
        "of motion is that of the push",
        "core.residuals.residual_bank",
        _nothing,
    ),
)
"""Every condition. No relation that is compiled holds load cell and commanded load: slack of the
load cell voids none."""
NAMED = {row.name: row for row in CONDITIONS}
