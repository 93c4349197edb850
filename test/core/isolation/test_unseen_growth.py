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

"""How far an error that grows may have come unseen."""

from __future__ import annotations

import pytest

from flea_diag.core.isolation.unseen_growth import SLACK, UnseenGrowth
from flea_diag.core.likelihood.fault_models import FaultModel, Size, Term

READ, UNREAD = "winding_temperature", "balance_of_forces"
UNSEEN = UnseenGrowth({READ: [(0.5, 3.0), (2.0, 2.0)]}, "elapsed_s", "one")
SIZES = (Size("drift", "K/s", -2.0, 2.0),)


def drift(age_s: float, residual: str = READ, gain: float = 1.0) -> FaultModel:
    terms = Term(residual, "elapsed_s", gain, 0), Term(residual, "one", gain * age_s, 0)
    return FaultModel("winding_temperature_drift", SIZES, terms)


@pytest.mark.parametrize(
    ("age_s", "most"), [(0.3, 2.0), (4.0, 2.0), (8.0, 2.0 / 6.0), (15.0, 2.0 / 13.0)]
)
def test_an_old_drift_is_slow_or_it_had_been_seen(age_s: float, most: float) -> None:
    (size,) = UNSEEN.bound(drift(age_s)).sizes
    assert (size.low, size.high) == pytest.approx((-min(2.0, SLACK * most), min(2.0, SLACK * most)))


def test_a_gain_counts_by_its_size() -> None:
    (one,), (twice,) = (UNSEEN.bound(drift(15.0, gain=gain)).sizes for gain in (1.0, -2.0))
    assert twice.high == pytest.approx(0.5 * one.high)


def test_what_is_not_tested_at_all_times_is_not_bounded() -> None:
    """Of a relation in motion nothing was seen at a standstill."""
    old = drift(15.0, UNREAD)
    bias = FaultModel("winding_temperature_bias", SIZES, (Term(READ, "one", 1.0, 0),))
    assert [UNSEEN.bound(model) for model in (old, bias)] == [old, bias]
