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

"""Which fault comes and goes, in windows that are made up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from flea_diag.core.evidence.fault_signatures import SizePrior
from flea_diag.core.recurrence.occurrence import gathered, rhythm
from flea_diag.core.recurrence.recurring import RecurringFault, recurring
from flea_diag.core.recurrence.stream_part import StreamPart

Array = npt.NDArray[np.float64]

WINDOWS = 200
CAME = (20, 51, 90, 118, 160)
"""Windows with which it comes, five times, for four windows each."""
PARTS = (1.0, 0.3, 0.45, 0.35, 0.7)
"""What each of these times shows of it, where something else hides the rest."""
ANY_SIZE = SizePrior(*(np.array([[mean], [mean]]) for mean in (0.0, 10.0, -np.inf, np.inf)))


def there() -> Array:
    """Share of the fault in each window."""
    share = np.zeros(WINDOWS)
    for first in CAME:
        share[first : first + 4] = 1.0
    return share


def swinging() -> Array:
    """What the first fault acts by, a current; the second acts by a constant."""
    return np.sin(0.3 * np.arange(WINDOWS))


def stream(signal: Array, share: Array, ways: Array | None = None) -> StreamPart:
    """One relation of unit noise that a fault of size 30 moves by this signal."""
    noise = np.random.default_rng(3).normal(size=WINDOWS)
    faults = np.stack((swinging(), np.ones(WINDOWS)), axis=-1)[:, None, :, None]
    errors = (noise + 30.0 * share * signal)[:, None]
    other = np.zeros((WINDOWS, 1)) if ways is None else ways[:, None]
    unit = np.abs(swinging())[:, None, None]
    return StreamPart(errors, faults, unit, other, np.zeros((WINDOWS, 1)))


def found(
    part: StreamPart, reading: int = -1, prior: SizePrior = ANY_SIZE, moments: int = 1
) -> list[RecurringFault]:
    return recurring(part, prior, np.array([True, True]), (reading, reading), moments)


def test_each_time_is_counted_and_its_size_is_told() -> None:
    (best, *_) = found(stream(np.ones(WINDOWS), there()))
    assert best.model == 1
    assert len(best.comings) == len(CAME)
    assert np.abs(best.comings - np.array(CAME)).max() <= 1
    assert best.whole
    assert best.size[0] == pytest.approx(30.0, rel=0.05)


def test_each_time_may_show_another_part_of_it() -> None:
    """Bursts are long, and no size that the fault may have explains all of them."""
    share = there()
    for first, part in zip(CAME, PARTS, strict=True):
        share[first : first + 4] *= part
    whole = SizePrior(*(np.array([[value], [value]]) for value in (29.0, 1.0, 27.0, 31.0)))
    (best, *_) = found(stream(np.ones(WINDOWS), share), prior=whole)
    assert best.model == 1
    assert best.whole
    assert len(best.comings) == len(CAME)


def test_a_fault_that_stays_comes_and_goes_by_what_it_acts_by() -> None:
    """Its current swings through zero: bursts by the dozen, and no coming and going."""
    assert found(stream(swinging(), np.ones(WINDOWS))) == []


def test_another_unit_stays_though_no_fault_looks_like_it() -> None:
    """It shows with the size of a current, as friction of a unit does with that of a load."""
    assert found(stream(np.abs(swinging()), np.ones(WINDOWS))) == []


def test_no_unit_makes_up_for_a_fault_whenever_it_is_gone() -> None:
    """A fault that stays, and a unit that differs by as much in each gap, would show the same."""
    part = stream(np.ones(WINDOWS), there())
    unit = (-30.0 * (1.0 - there()))[:, None, None]
    assert found(replace(part, units=unit)) == []  # windows are too long to say so
    (best, *_) = found(replace(part, units=unit), moments=2)
    assert best.model == 1
    assert len(best.comings) == len(CAME)


def test_what_stays_in_another_relation_hides_nothing() -> None:
    """A reading is off by a little all the time, which says far more than five bursts do."""
    noise = np.random.default_rng(3).normal(size=(WINDOWS, 2))
    errors = noise + np.column_stack((30.0 * there(), np.full(WINDOWS, 1.5)))
    faults = np.zeros((WINDOWS, 2, 2, 1))
    faults[:, 1, 0], faults[:, 0, 1] = 1.0, 1.0
    nothing = np.zeros((WINDOWS, 2, 1))
    part = StreamPart(errors, faults, nothing, nothing[:, 0], nothing[:, 0])
    (best,) = found(part)
    assert best.model == 1
    assert len(best.comings) == len(CAME)


def test_it_is_not_counted_anew_after_windows_that_could_hardly_show_it() -> None:
    """Amid each burst the relation that shows most of it has no value, and another says nothing."""
    noise = np.random.default_rng(3).normal(size=(WINDOWS, 2))
    faults = np.zeros((WINDOWS, 2, 1, 1))
    faults[:, 0], faults[:, 1] = 1.0, 0.3
    errors = noise + np.column_stack((100.0 * there(), 30.0 * there()))
    for first in CAME:
        void = slice(first + 1, first + 3)
        faults[void, 0], errors[void, 0], errors[void, 1] = 0.0, 0.0, noise[void, 1]
    nothing = np.zeros((WINDOWS, 2, 1))
    part = StreamPart(errors, faults, nothing, nothing[:, 0], nothing[:, 0])
    wide = SizePrior(*(np.array([[value]]) for value in (0.0, 100.0, -np.inf, np.inf)))
    (best,) = recurring(part, wide, np.array([True]), (-1,))
    assert len(best.comings) == len(CAME)


def test_what_follows_a_burst_and_is_no_part_of_it_hides_nothing() -> None:
    """A controller that makes up for what was lost draws more current for a while."""
    share = there()
    for first in CAME:
        share[first + 4 : first + 10] = -0.5
    positive = SizePrior(*(np.array([[v], [v]]) for v in (20.0, 20.0 / 3**0.5, 0.0, 40.0)))
    part = stream(np.ones(WINDOWS), share)
    (best,) = recurring(part, positive, np.array([False, True]), (-1, -1))
    assert len(best.comings) == len(CAME)


def test_what_is_there_in_one_direction_alone_may_stay() -> None:
    ways = np.where(there() > 0.0, 1.0, -1.0)
    assert found(stream(np.ones(WINDOWS), there(), ways)) == []


def test_three_times_are_not_enough() -> None:
    share = there()
    share[CAME[3] :] = 0.0
    assert found(stream(np.ones(WINDOWS), share)) == []


def test_an_error_of_a_reading_that_never_jumps_is_none() -> None:
    part = stream(np.ones(WINDOWS), there())
    assert found(part, reading=0) == []


def test_noise_is_quiet() -> None:
    assert found(stream(np.ones(WINDOWS), np.zeros(WINDOWS))) == []


def test_a_rhythm_is_told_though_one_time_is_missing() -> None:
    times_s = np.delete(np.arange(10.0, 30.0, 2.0), 4) + 0.05
    assert rhythm(times_s) == pytest.approx(2.0, abs=0.05)
    assert math.isnan(rhythm(np.cumsum([2.0, 2.9, 1.1, 3.7, 1.6, 2.4, 3.3])))


def test_a_place_is_told_from_where_it_was_anyway() -> None:
    everywhere = np.linspace(0.0, 0.1, 500)
    assert gathered(np.full(8, 0.031), everywhere) == pytest.approx(0.031)
    assert math.isnan(gathered(np.linspace(0.005, 0.095, 8), everywhere))
