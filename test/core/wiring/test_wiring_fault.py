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

from __future__ import annotations

import math

import numpy as np
import pytest
from support.observed import FLEA

from flea_diag.core.wiring.candidates import lags, wiring_faults
from flea_diag.core.wiring.wiring_fault import (
    CLIPPED,
    FACTOR,
    FACTORS,
    LATE,
    SWAPPED,
    TURNED,
    WiringFault,
    at_ends,
)

INDEX = {"one": 0, "other": 1}
RIGHT = np.column_stack((np.sin(np.arange(40.0)), np.arange(40.0)))


def wired_wrong(fault: WiringFault) -> np.ndarray:
    """What is read of ``RIGHT``."""
    rows = RIGHT.copy()
    if fault.kind == TURNED:
        rows[:, 0] *= -1.0
    elif fault.kind == FACTOR:
        rows[:, 0] *= fault.factor
    elif fault.kind == SWAPPED:
        rows = rows[:, ::-1].copy()
    elif fault.kind == LATE:
        rows[fault.scans :, 0] = RIGHT[: -fault.scans, 0]
    return rows


@pytest.mark.parametrize(
    "fault",
    [
        WiringFault(TURNED, "one"),
        WiringFault(FACTOR, "one", factor=25.4),
        WiringFault(SWAPPED, "one", other="other"),
        WiringFault(LATE, "one", scans=3),
    ],
    ids=lambda fault: fault.kind,
)
def test_undone_it_is_as_it_was(fault: WiringFault) -> None:
    read = wired_wrong(fault)
    before = read.copy()
    undone = fault.undone(read, INDEX)
    np.testing.assert_allclose(undone, RIGHT[: len(undone)], rtol=1e-12)
    assert len(undone) == len(RIGHT) - fault.scans
    np.testing.assert_array_equal(read, before)


def test_what_is_cut_off_cannot_be_known() -> None:
    read = np.clip(RIGHT, -0.5, 0.5)
    undone = WiringFault(CLIPPED, "one").undone(read, INDEX)
    assert np.array_equal(np.isnan(undone[:, 0]), np.abs(RIGHT[:, 0]) >= 0.5)
    assert np.isfinite(undone[:, 1]).all()


def test_ends_are_where_readings_go_no_further() -> None:
    assert at_ends(np.array([0.0, 1.0, 2.0, 2.0, np.nan])).tolist() == [
        True, False, True, True, False,
    ]  # fmt: skip


def test_every_factor_has_its_inverse_and_words() -> None:
    for factor, words in FACTORS.items():
        assert words
        assert any(math.isclose(1.0 / factor, other) for other in FACTORS)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (WiringFault(TURNED, "load_force"), "load_force: its sign is turned"),
        (WiringFault(LATE, "load_force", scans=20), "load_force: it comes 200 ms late"),
        (WiringFault(FACTOR, "load_force", factor=25.4), "load_force: it reads 25.4 (inch, mm)"),
        (WiringFault(SWAPPED, "a", other="b"), "a and b are swapped"),
        (WiringFault(CLIPPED, "a"), "a: it is cut off"),
    ],
)
def test_words_say_what_is_wrong_with_the_number(fault: WiringFault, words: str) -> None:
    assert fault.words(0.01).startswith(words)
    assert fault.remedy


def test_lags_end_at_300_ms() -> None:
    assert [w.scans for w in lags("a", 0.01)] == list(range(1, 31))


def test_candidates_are_those_of_the_suspects_that_change() -> None:
    known = FLEA
    rows = np.tile(np.sin(np.arange(200.0))[:, None], (1, len(known.channels)))
    rows[:, known.index["load_position"]] = 1.0
    found = list(wiring_faults(known, rows, ("commanded_voltage", "load_position")))
    assert {w.channel for w in found if w.kind == TURNED} == {"commanded_voltage"}
    pairs = {w.channels for w in found if w.kind == SWAPPED}
    assert pairs == {("motor_voltage", "commanded_voltage")}
    assert CLIPPED not in {w.kind for w in found}
    rows[:, known.index["commanded_voltage"]] = np.clip(rows[:, 0], -0.5, 0.5)
    found = list(wiring_faults(known, rows, ("commanded_voltage",)))
    assert WiringFault(CLIPPED, "commanded_voltage") in found


def test_a_silent_channel_stands_at_its_mean() -> None:
    silent = WiringFault(TURNED, "one").silent(RIGHT, INDEX)
    np.testing.assert_allclose(silent[:, 0], -RIGHT[:, 0].mean())
    np.testing.assert_array_equal(silent[:, 1], RIGHT[:, 1])


@pytest.mark.filterwarnings("error")
def test_of_a_channel_that_never_moves_nothing_is_known_beside_its_limits() -> None:
    rows = RIGHT.copy()
    rows[:, 0] = 2.0
    assert np.isnan(WiringFault(CLIPPED, "one").silent(rows, INDEX)[:, 0]).all()
