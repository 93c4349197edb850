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

"""What people do about a fault, stated or not, of one fault and of a group."""

from __future__ import annotations

import pytest

from flea_diag.configuration.description import faults_of
from flea_diag.configuration.stand import load_stand, shipped_stands
from flea_diag.core.faults.response import LONGEST, Response, completed, to_do


def test_a_fault_without_any_words_has_an_answer() -> None:
    abrupt = completed(Response(), "belt_torn", "drive belt", "abrupt", "motion", "")
    assert abrupt == Response(
        "Belt torn", "drive belt", "", "now", "stop", "Show it again: motion.",
        "Inspect the drive belt.",
    )  # fmt: skip
    worn = completed(Response(run="stop"), "belt_worn", "drive belt", "incipient", "", "")
    assert (worn.urgency, worn.run, worn.next_test) == ("planned", "stop", "")
    sensor = completed(Response(), "motor_current_dead", "sensor", "abrupt", "", "motor_current")
    assert (sensor.name, sensor.run) == ("Sensor of motor current dead", "go on")
    assert "motor current with a second instrument" in sensor.procedure


def test_what_is_stated_is_said() -> None:
    given = Response("Torn belt", "belt", "under the hood", "soon", "go on", "Pull it.", "Look.")
    assert completed(given, "belt_torn", "drive belt", "abrupt", "motion", "") == given


def test_the_most_urgent_of_a_group_makes_it_urgent_and_stops_it() -> None:
    worn = Response("Worn", "belt", "", "planned", "go on", "Pull it.", "Look.")
    torn = Response("Torn", "belt", "", "now", "stop", "", "Stop.")
    told = dict(to_do((worn, torn)))
    assert told == {
        "run": "stop", "urgency": "now", "name": "Worn; Torn", "part": "belt",
        "procedure": "Look.", "next_test": "Pull it.",
    }  # fmt: skip
    assert to_do(()) == ()


def test_of_many_and_long_ones_no_more_is_said_than_fits() -> None:
    many = [Response(f"n{k}", f"p{k}" * 200, "", "soon", "go on", "t" * 999, "p") for k in range(9)]
    told = dict(to_do(many))
    assert "name" not in told
    assert max(map(len, told.values())) == LONGEST


@pytest.mark.parametrize("stand", sorted(shipped_stands()))
def test_every_fault_of_a_shipped_stand_says_what_to_do(stand: str) -> None:
    known = load_stand(stand)
    for fault in faults_of(known.actuator, known.faults).values():
        told = dict(to_do((fault.response,)))
        assert {"run", "urgency", "name", "part", "procedure"} <= set(told), fault.name
