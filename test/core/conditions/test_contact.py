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

"""Contact with a stop: the evidence that begins and ends it, and its bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from flea_diag.core.conditions.contact import (
    LONGEST_S,
    PUSH,
    TRIED_S,
    TURNS,
    Contact,
    Signs,
    following,
    missing_force,
)
from flea_diag.core.residuals.residual import STALL

PRESSED = Signs(1, True, 5.0, False, 0.1, 0.31)
"""Near the upper end, it stands, and five dry frictions are missing."""


def test_pressed_against_its_stop_it_is_in_contact() -> None:
    assert following(Contact.ARRIVING, PRESSED) is Contact.HELD
    assert following(Contact.NEAR, PRESSED) is Contact.HELD


@pytest.mark.parametrize(
    "lacking",
    [
        {"end": 0},
        {"still": False},
        {"reaction": PUSH},
        {"reaction": -5.0},
        {"reaction": math.nan},
        {"turns": True},
    ],
    ids=str,
)
def test_each_piece_of_evidence_is_needed(lacking: dict[str, object]) -> None:
    assert following(Contact.NEAR, replace(PRESSED, **lacking)) is not Contact.HELD


def test_a_push_that_is_called_a_stall_is_called_contact_near_an_end() -> None:
    assert PUSH < STALL


def test_an_arrival_is_excused_for_a_while_only() -> None:
    waiting = replace(PRESSED, reaction=0.0)
    assert following(Contact.ARRIVING, replace(waiting, elapsed_s=TRIED_S - 0.01)).voids
    assert not following(Contact.ARRIVING, replace(waiting, elapsed_s=TRIED_S)).voids


def test_contact_is_excused_for_a_while_only() -> None:
    assert following(Contact.HELD, replace(PRESSED, elapsed_s=LONGEST_S - 0.01)) is Contact.HELD
    over = following(Contact.HELD, replace(PRESSED, elapsed_s=LONGEST_S))
    assert over is Contact.OVERDUE
    assert not over.voids
    assert following(over, PRESSED) is Contact.OVERDUE


@pytest.mark.parametrize("freed", [{"end": 0}, {"turns": True}, {"reaction": -PUSH - 0.1}], ids=str)
def test_it_ends_where_the_stop_is_left_or_cannot_be_what_holds(freed: dict[str, object]) -> None:
    """A stop pushes back only: what stands although it is pushed away from the end is jammed."""
    after = following(Contact.HELD, replace(PRESSED, **freed))
    assert after is Contact.LEAVING
    gone = replace(PRESSED, **{"reaction": 0.0, **freed}, elapsed_s=0.31)
    assert after.voids
    assert not following(after, gone).voids


def test_every_state_can_be_left() -> None:
    assert set(TURNS) == set(Contact)
    for state, rows in TURNS.items():
        assert rows
        assert all(then is not state for _, then in rows)


def test_the_missing_force_pushes_back_from_either_end() -> None:
    """At gain -1 the residual is the reaction: 120 N are three frictions of 40 N."""
    assert missing_force(120.0, -1.0, 1, 40.0) == pytest.approx(3.0)
    assert missing_force(-120.0, -1.0, -1, 40.0) == pytest.approx(3.0)
    assert missing_force(120.0, -1.0, -1, 40.0) == pytest.approx(-3.0)
    assert math.isnan(missing_force(120.0, -1.0, 1, 0.0))
