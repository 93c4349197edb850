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

"""Shifts of a level within a run: what they are, what they know nothing of, and blocks."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from support.observed import FLEA_COUNTS

from flea_diag.core.detection.mean_shift import (
    GAP_S,
    LEAST_ALWAYS_S,
    LEAST_S,
    REFERENCE_S,
    SHIFT_WINDOWS_S,
    MeanShift,
    MeanShiftLimit,
)
from flea_diag.errors import ConfigurationError
from flea_diag.fields.reader import read_as

WINDOW = FLEA_COUNTS.of(SHIFT_WINDOWS_S[0])
REFERENCE, LEAST, LEAST_ALWAYS = map(FLEA_COUNTS.of, (REFERENCE_S, LEAST_S, LEAST_ALWAYS_S))


def shifts(values: np.ndarray, use: np.ndarray | None = None, block: int = 100_000) -> np.ndarray:
    level = MeanShift(counts=FLEA_COUNTS)
    use = np.ones(len(values), dtype=bool) if use is None else use
    values, use = values[:, None, None], use[:, None]
    parts = range(0, len(values), block)
    rows = [level.step(values[k : k + block], use[k : k + block]) for k in parts]
    return np.concatenate(rows)[:, 0, 0, 0]


def test_a_shift_is_the_mean_of_the_window_less_that_of_what_came_before():
    values = np.random.default_rng(3).standard_normal(4000)
    found = shifts(values)
    assert np.isnan(found[: LEAST + WINDOW - 1]).all()
    for now in (LEAST + WINDOW, 1500, 4000):
        earlier = values[max(now - WINDOW - REFERENCE, 0) : now - WINDOW]
        expected = values[now - WINDOW : now].mean() - earlier.mean()
        assert found[now - 1] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("gated", "least"), [(True, LEAST), (False, LEAST_ALWAYS)])
def test_a_level_that_counts_at_rest_needs_more_samples(gated, least):
    level = MeanShift([gated], counts=FLEA_COUNTS)
    found = level.step(np.zeros((1000, 1, 1)), np.ones((1000, 1), dtype=bool))[:, 0, 0, 0]
    assert np.flatnonzero(np.isfinite(found))[0] == least + WINDOW - 1


def test_a_constant_offset_of_the_unit_is_no_shift_and_a_step_is_one():
    values = np.full(1500, 7.5)
    assert np.nanmax(np.abs(shifts(values))) < 1e-12
    values[1000:] += 2.0
    assert shifts(values)[1199] == pytest.approx(2.0)


@pytest.mark.parametrize("block", [1, 7, 256])
def test_blocks_give_the_same_bits_with_rests_and_holes(block):
    draw = np.random.default_rng(4)
    values, use = draw.standard_normal(3500), draw.random(3500) > 0.2
    values[[40, 41, *range(900, 960)]] = np.nan
    assert np.array_equal(shifts(values, use), shifts(values, use, block), equal_nan=True)


def test_at_rest_the_last_shift_stands():
    values, use = np.random.default_rng(5).standard_normal(900), np.ones(900, dtype=bool)
    use[700:] = False
    found = shifts(values, use)
    assert np.isfinite(found[699])
    assert (found[700:] == found[699]).all()


@pytest.mark.parametrize("block", [1, 33, 1500])
def test_after_a_long_gap_a_new_level_begins_and_a_short_one_is_outlasted(block):
    gap = FLEA_COUNTS.of(GAP_S)
    values = np.concatenate((np.zeros(700), np.full(gap + 1, np.nan), np.full(700, 9.0)))
    found = shifts(values, block=block)
    assert np.isnan(found[700 + gap : 701 + gap + LEAST + WINDOW - 1]).all()
    assert np.nanmax(np.abs(found)) < 1e-12
    found = shifts(np.delete(values, 700), block=block)
    assert found[700 + gap + WINDOW - 1] == pytest.approx(9.0)


def test_a_frozen_level_does_not_follow_the_fault():
    level, use = MeanShift(counts=FLEA_COUNTS), np.ones((1000, 1), dtype=bool)
    level.step(np.zeros((1000, 1, 1)), use)
    level.freeze()
    for _ in range(5):
        last = level.step(np.ones((1000, 1, 1)), use)[-1, 0, 0, 0]
    assert last == pytest.approx(1.0)
    level.clear()
    assert np.isnan(level.step(np.ones((10, 1, 1)), use[:10])).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"window": 0}, "window = 0"),
        ({"sigma": 0.0}, "sigma = 0.0 must be above 0"),
        ({"k": float("nan")}, "k = nan must be a finite number"),
        ({"k": True}, "k = True must be a number"),
        ({"more": 1}, "unknown key 'more'"),
        ({"along": 1}, "along = 1 must be"),
    ],
)
def test_a_limit_that_makes_no_sense_is_refused(change, words):
    limit = MeanShiftLimit("parity_electrical", WINDOW, 0.3, 5.0)
    assert read_as(MeanShiftLimit, limit.to_mapping()) == limit
    assert set(limit.to_mapping()) == {"name", "window", "sigma", "k"}
    with pytest.raises(ConfigurationError, match=words):
        read_as(MeanShiftLimit, {**limit.to_mapping(), **change})


@pytest.mark.parametrize("before", [LEAST, 4 * REFERENCE])
def test_a_copy_goes_on_with_the_same_bits_and_leaves_the_first_as_it_was(before):
    draw = np.random.default_rng(8)
    first = MeanShift(counts=FLEA_COUNTS)
    first.step(draw.standard_normal((before, 1, 1)), np.ones((before, 1), dtype=bool))
    more = draw.standard_normal((500, 1, 1)), np.ones((500, 1), dtype=bool)
    copied = deepcopy(first)
    found = deepcopy(first).step(*more)
    assert copied.step(*more).tobytes() == first.step(*more).tobytes() == found.tobytes()
