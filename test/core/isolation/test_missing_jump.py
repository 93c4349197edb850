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


def remembered(content: np.ndarray, stamps_ns: np.ndarray = STAMPS_NS) -> JumpMemory:
    memory = JumpMemory(NAMES, ("load_force",), COUNTS)
    memory.add(stamps_ns, content)
    return memory


def test_the_largest_jump_is_remembered_with_its_share_of_the_reading():
    found = remembered(rows(at=700)).largest(int(STAMPS_NS[800]))
    assert found["load_force"] == Jump(50.0, 50.0 / 150.0)


def test_of_shares_those_count_that_are_not_older_than_a_test():
    found = remembered(rows(at=100)).largest(int(STAMPS_NS[800]))["load_force"]
    assert (found.size, found.share) == (50.0, pytest.approx(0.5 / 100.5))


def test_nothing_is_known_too_soon_at_rest_or_of_an_older_observer():
    assert not remembered(rows()).largest(int(STAMPS_NS[300]))
    assert not remembered(rows(moving=0.0)).largest(int(STAMPS_NS[800]))
    assert not remembered(rows()[:, :4]).largest(int(STAMPS_NS[800]))


def test_a_jump_may_hide_where_scans_are_lost():
    kept = np.r_[0:500, 503:SCANS]
    found = remembered(rows()[kept], STAMPS_NS[kept]).largest(int(STAMPS_NS[800]))
    assert math.isnan(found["load_force"].size)


def test_a_jump_may_hide_where_a_reading_is_missing():
    content = rows()
    content[500, 2] = math.nan
    found = remembered(content).largest(int(STAMPS_NS[800]))
    assert math.isnan(found["load_force"].size)


def test_a_single_lost_scan_hides_none_for_a_jump_lasts_two():
    kept = np.r_[0:500, 501:SCANS]
    found = remembered(rows()[kept], STAMPS_NS[kept]).largest(int(STAMPS_NS[800]))
    assert found["load_force"].size == 0.5


def test_what_is_more_than_a_minute_old_is_forgotten():
    memory = remembered(rows(at=100))
    for minute in range(1, 8):
        memory.add(STAMPS_NS + minute * 10_000_000 * SCANS, rows())
    found = memory.largest(int(STAMPS_NS[-1]) + 7 * 10_000_000 * SCANS)
    assert found["load_force"].size == 0.5


@given(st.lists(st.integers(1, SCANS - 1), max_size=6))
def test_scans_may_come_in_blocks_of_any_size(cuts):
    content, detected_ns = rows(at=430), int(STAMPS_NS[800])
    memory = JumpMemory(NAMES, ("load_force",), COUNTS)
    ends = [0, *sorted(set(cuts)), SCANS]
    for a, b in pairwise(ends):
        memory.add(STAMPS_NS[a:b], content[a:b])
    assert memory.largest(detected_ns) == remembered(content).largest(detected_ns)


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
        ("load_force_bias", -60.0, Jump(59.0, 2.0), False),
        ("load_force_bias", -10.0, Jump(9.0, 2.0), False),
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
