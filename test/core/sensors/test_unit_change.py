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

"""Thermocouples that step together are another unit's; one that steps alone is a fault."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import stands
from support.stand_runs import records

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.core.sensors.unit_change import AFTER, BEFORE, PERIOD, UnitChange
from flea_diag.wire.records import AmbiguityGroup, Detection, Outcome, Record, Scan, Truth

Array = npt.NDArray[np.float64]
NOISE_K = (0.5, 1.6, 0.003)
"""Of motor, nut and ambient on the FLEA."""
AT = 700


def readings(scans: int = 1000, seed: int = 1) -> Array:
    draw = np.random.default_rng(seed)
    found = 25.0 + draw.standard_normal((scans, 3)) * NOISE_K
    spikes = draw.random((scans, 2)) < 0.01
    found[:, :2][spikes] += draw.choice([-30.0, 10.0], np.count_nonzero(spikes))
    return found


def stepped(*sizes_k: float, seed: int = 1) -> Array:
    found = readings(seed=seed)
    found[AT:] += sizes_k
    return found


@pytest.mark.parametrize("sizes_k", [(4.0, 7.0, 0.0), (-2.0, 0.0, 1.0), (6.0, -5.0, 1.0)])
def test_two_that_step_are_seen_within_a_fifth_of_a_second(
    sizes_k: tuple[float, float, float],
) -> None:
    for seed in range(10):
        seen = UnitChange().follow(stepped(*sizes_k, seed=seed))
        assert AT <= seen <= AT + AFTER + PERIOD + 4


@pytest.mark.parametrize("sizes_k", [(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 0.0, -5.0)])
def test_one_alone_or_none_is_no_change(sizes_k: tuple[float, float, float]) -> None:
    for seed in range(20):
        assert UnitChange().follow(stepped(*sizes_k, seed=seed)) == 1000


@pytest.mark.parametrize(("every", "seen"), [(1, False), (50, True)])
def test_a_reading_that_dies_is_of_no_unit(every: int, seen: bool) -> None:
    """But one that comes twice a second stands still after any step."""
    for seed in range(20):
        found = stepped(4.0, 0.0, 1.0, seed=seed)
        found[AT:, 0] = found[AT, 0]
        found[:, 0] = np.repeat(found[::every, 0], every)
        assert (UnitChange().follow(found) < 1000) is seen


def test_heat_is_no_change() -> None:
    heating = readings() + 0.1 * np.arange(1000)[:, None] / 100.0  # 0.1 K/s, as at an end stop
    assert UnitChange().follow(heating) == 1000


def test_what_is_not_measured_is_not_judged() -> None:
    found = stepped(4.0, 0.0, 1.0)
    found[:, 2] = np.nan
    assert UnitChange().follow(found) == 1000
    assert UnitChange().follow(found[:BEFORE]) == BEFORE


@given(st.lists(st.integers(1, 400), min_size=1, max_size=12))
def test_blocks_of_any_length_see_the_same(lengths: list[int]) -> None:
    found = stepped(-2.0, 0.0, 1.0)
    whole = UnitChange().follow(found)
    unit, start = UnitChange(), 0
    for length in (*lengths, 1000):
        part = found[start : start + length]
        seen = unit.follow(part)
        if seen < len(part):
            assert start + seen == whole
            return
        start += len(part)
    pytest.fail("no block has seen it")


@cache
def quiet() -> tuple[Record, ...]:
    return tuple(record for record in records(duration_s=24.0) if not isinstance(record, Truth))


def diagnosed(**steps_k: float) -> list[Record]:
    """What is said of a healthy run whose temperatures step after 14 s."""
    pipeline = make_pipeline(load_stand())
    first = next(record.stamp_ns for record in quiet() if isinstance(record, Scan))
    given: list[Record] = []
    for record in quiet():
        if isinstance(record, Scan) and record.stamp_ns >= first + 14_000_000_000:
            pairs = zip(record.channels, record.values, strict=True)
            values = tuple(value + steps_k.get(name, 0.0) for name, value in pairs)
            record = replace(record, values=values)
        given.append(record)
    return stands.replay(pipeline, given)


@pytest.mark.slow
def test_another_unit_is_named_and_is_no_fault() -> None:
    said = diagnosed(motor_temperature=5.0, nut_temperature=-4.0)
    assert not [record for record in said if isinstance(record, Detection) and record.detected]
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.outcome is Outcome.NOMINAL
    assert "unit exchanged 14." in last.words


@pytest.mark.slow
def test_a_thermocouple_alone_is_still_a_fault() -> None:
    said = diagnosed(motor_temperature=8.0)
    last = [record for record in said if isinstance(record, AmbiguityGroup)][-1]
    assert last.members
    assert all(member.fault.startswith("motor_temperature") for member in last.members)
    assert "another unit" not in last.words
