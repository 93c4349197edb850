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

"""The table of conditions: what each voids follows from the graph, and who judges it exists."""

from __future__ import annotations

import importlib

import pytest
from support.observed import FLEA_COUNTS

from flea_diag.configuration.description import compiled_relations
from flea_diag.core.conditions.condition import CONDITIONS, NAMED
from flea_diag.stages.observer.speed_trust import SpeedTrust
from flea_diag.stages.observer.voltage_trust import VoltageTrust
from flea_diag.wire.records import END_OF_TRAVEL

FLEA = compiled_relations("actuator.yaml")


def voided(name: str) -> list[str]:
    return [FLEA.residuals.rows[j].name for j in NAMED[name].columns(FLEA)]


@pytest.mark.parametrize("row", CONDITIONS, ids=lambda row: row.name)
def test_a_row_is_judged_somewhere_or_voids_nothing(row: object) -> None:
    name = row.judged_by
    if name:
        importlib.import_module(f"flea_diag.{name}")
    else:
        assert NAMED[row.name].columns(FLEA) == []


def test_the_end_of_travel_voids_the_balance_of_forces_and_what_an_impact_heats() -> None:
    balance = ["parity_mechanical", "parity_mechanical_dn"]
    assert voided(END_OF_TRAVEL) == [*balance, "nut_temperature"]
    assert NAMED[END_OF_TRAVEL].longest_s is not None


def test_a_saturated_drive_voids_what_holds_the_command() -> None:
    assert voided("saturated_drive") == ["parity_drive"]


def test_conditions_that_other_parts_judge_void_what_those_leave_out() -> None:
    rows = FLEA.residuals
    assert NAMED["untrusted_voltage"].columns(FLEA) == VoltageTrust(rows, 1.0, FLEA_COUNTS).columns
    assert NAMED["stepped_position"].columns(FLEA) == SpeedTrust(rows, False, 31).columns


def test_standing_against_a_push_voids_nothing() -> None:
    assert voided("standing_against_push") == []
