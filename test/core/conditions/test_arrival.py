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

"""A position is believed at an end if it moved there."""

from __future__ import annotations

import numpy as np
import pytest

from flea_diag.core.conditions.arrival import arrived, still

DT, WIDTH = 0.01, 0.002
SPEED = np.full(50, -0.05)
MOVED = 0.025 + np.cumsum(SPEED) * DT
UNKNOWN = np.full(50, np.nan)


def test_what_moved_there_as_the_motor_turned_has_arrived() -> None:
    assert arrived(MOVED, SPEED, DT, WIDTH)
    assert arrived(MOVED, UNKNOWN, DT, WIDTH)


def test_a_sensor_that_died_at_the_end_has_not() -> None:
    dead = np.where(np.arange(50) < 30, MOVED + 0.02, 0.0)
    assert not arrived(dead, UNKNOWN, DT, WIDTH)


def test_nor_if_its_first_readings_were_withheld() -> None:
    dead = np.where(np.arange(50) < 30, MOVED + 0.02, 0.0)
    dead[30:35] = np.nan
    assert not arrived(dead, UNKNOWN, DT, WIDTH)


def test_nor_has_one_that_moves_while_the_motor_stands_or_stands_while_it_turns() -> None:
    assert not arrived(MOVED, np.zeros(50), DT, WIDTH)
    assert not arrived(np.zeros(50), SPEED, DT, WIDTH)


def test_a_stream_that_begins_at_the_end_is_believed() -> None:
    assert arrived(np.append(np.full(49, np.nan), 0.0), UNKNOWN, DT, WIDTH)


@pytest.mark.parametrize(
    ("readings", "stands"),
    [
        ([[0.1, 0.1002, 0.1001]], True),
        ([[0.1, 0.0985, 0.1]], False),
        ([[0.1, 0.1], [0.1, 0.09]], False),
        ([[np.nan, 0.1]], False),
        ([[np.nan, 0.1], [0.1, 0.1001]], True),
        ([], False),
    ],
)
def test_it_stands_where_every_known_reading_does(
    readings: list[list[float]], stands: bool
) -> None:
    assert still([np.array(column) for column in readings], 0.0005) is stands
