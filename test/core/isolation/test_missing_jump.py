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
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import stands

from flea_diag.core.isolation.missing_jump import Jump, JumpMemory, missing_jump
from flea_diag.core.likelihood.fit import Fit
from flea_diag.core.scan_counts import ScanCounts

COUNTS = ScanCounts(0.01)
NAMES = ("one", "load_force")
SCANS = 1000
STAMPS_NS = 10**18 + 10_000_000 * np.arange(SCANS)


def rows(at: int = -1, jump: float = 50.0, moving: float = 1.0) -> np.ndarray:
    """Signals, the jump of the load cell, speed and motion; one jump among small ones."""
    found = np.tile([1.0, 100.0, 0.5, 0.02, moving], (SCANS, 1))
    if at >= 0:
        found[at : at + 2, 2] = jump
    return found


def empty() -> JumpMemory:
    return JumpMemory(NAMES, ("load_force",), ("balance", "circuit"), COUNTS)


def values(scans: int = SCANS, void: slice = slice(0)) -> np.ndarray:
    """Residuals, of which the balance has no value for a while."""
    found = np.zeros((scans, 2))
    found[void, 0] = math.nan
    return found


def remembered(
    content: np.ndarray, stamps_ns: np.ndarray = STAMPS_NS, void: slice = slice(0)
) -> JumpMemory:
    memory = empty()
    memory.add(stamps_ns, content, values(len(content), void))
    return memory


def largest(
    memory: JumpMemory, detected: int = 800, until: int = 800, told: str = ""
) -> Jump | None:
    start_ns = int(STAMPS_NS[0])
    found = memory.largest(start_ns + 10_000_000 * detected, start_ns + 10_000_000 * until, told)
    return found.get("load_force")


SMALL = 0.5 / 100.5


@pytest.mark.parametrize(
    ("jump", "size", "share"),
    [(50.0, 49.5, 50.0 / 150.0 - SMALL), (-50.0, 50.5, SMALL + 50.0 / 50.0)],
)
def test_jumps_are_remembered_with_what_motion_may_take_from_them(jump, size, share):
    found = largest(remembered(rows(at=700, jump=jump)))
    assert (found.size, found.share) == (size, pytest.approx(share))
    assert largest(remembered(rows())) == Jump(0.0, 0.0)


@pytest.mark.parametrize("at", [100, 950])
def test_those_count_that_are_neither_older_than_a_test_nor_later_than_told(at):
    assert largest(remembered(rows(at=at))) == Jump(0.0, 0.0)
    assert largest(remembered(rows(at=at)), until=960).size == (49.5 if at > 800 else 0.0)


def test_those_count_from_before_a_rest():
    content = np.concatenate((rows(), rows(at=100)))
    content[SCANS + 200 : SCANS + 700, -1] = 0.0
    memory = remembered(content, int(STAMPS_NS[0]) + 10_000_000 * np.arange(2 * SCANS))
    assert largest(memory, 1800, 1800).size == 49.5


@pytest.mark.parametrize(("told", "size"), [("balance", 49.5), ("circuit", 0.0), ("", 0.0)])
def test_those_count_since_which_what_told_it_had_no_value(told, size):
    memory = remembered(rows(at=250), void=slice(400, 750))
    assert largest(memory, told=told).size == size


def test_nothing_is_known_while_what_told_it_had_no_value():
    assert largest(remembered(rows(), void=slice(0, 750)), told="balance") is None


def test_nothing_is_known_too_soon_at_rest_or_of_an_older_observer():
    assert not largest(remembered(rows()), 300)
    assert not largest(remembered(rows(moving=0.0)))
    assert not largest(remembered(rows()[:, :4]))


def test_a_jump_may_hide_where_scans_are_lost():
    kept = np.r_[0:500, 503:SCANS]
    assert math.isnan(largest(remembered(rows()[kept], STAMPS_NS[kept])).size)


def test_a_jump_may_hide_where_a_reading_is_missing():
    content = rows()
    content[500, 2] = math.nan
    assert math.isnan(largest(remembered(content)).size)


def test_a_single_lost_scan_hides_none_for_a_jump_lasts_two():
    kept = np.r_[0:500, 501:SCANS]
    assert largest(remembered(rows()[kept], STAMPS_NS[kept])).size == 0.0


def test_what_is_more_than_a_minute_old_is_forgotten():
    memory = remembered(rows(at=700))
    assert largest(memory).size == 49.5
    for minute in range(1, 8):
        memory.add(STAMPS_NS + minute * 10_000_000 * SCANS, rows(moving=0.0), values())
    assert largest(memory, 7 * SCANS, 7 * SCANS) is None


@given(st.lists(st.integers(1, SCANS - 1), max_size=6))
def test_scans_may_come_in_blocks_of_any_size(cuts):
    content = rows(at=430)
    memory = empty()
    ends = [0, *sorted(set(cuts)), SCANS]
    for a, b in pairwise(ends):
        memory.add(STAMPS_NS[a:b], content[a:b], values(b - a))
    assert largest(memory) == largest(remembered(content))


@dataclass
class Known:
    """A solution with a standard error."""

    sigma: float = 1.0

    def sigmas(self) -> tuple[float, ...]:
        return (self.sigma,)


@pytest.mark.parametrize(
    ("fault", "size", "jump", "is_missing"),
    [
        ("load_force_bias", -60.0, Jump(9.0, 2.0), True),
        ("load_force_bias", -60.0, Jump(51.0, 2.0), True),
        ("load_force_bias", -60.0, Jump(53.0, 2.0), False),
        ("load_force_bias", -10.0, Jump(8.0, 2.0), False),
        ("load_force_bias", -60.0, Jump(math.nan, 2.0), False),
        ("load_force_scaling", 8.0, Jump(900.0, 0.1), True),
        ("load_force_scaling", 8.0, Jump(9.0, 7.0), False),
        ("load_force_drift", 60.0, Jump(9.0, 2.0), False),
        ("jam", 60.0, Jump(9.0, 2.0), False),
    ],
)
def test_an_error_that_begins_at_once_needs_a_jump(fault, size, jump, is_missing):
    fit = Fit(fault, 9.0, (size,), Known())
    assert (
        bool(missing_jump(stands.knowledge().faults[fault], fit, {"load_force": jump}))
        is is_missing
    )


def test_without_a_size_or_a_memory_nothing_is_missing():
    bias = stands.knowledge().faults["load_force_bias"]
    assert not missing_jump(bias, None, {"load_force": Jump(0.0, 0.0)})
    assert not missing_jump(bias, Fit("load_force_bias", 9.0, (60.0,), Known()), {})
    # No relation of the stand has a size of it.
    assert not missing_jump(bias, Fit("load_force_bias", 0.0, ()), {"load_force": Jump(0.0, 0.0)})
