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

"""A verdict as numbers: what a plot draws and a program branches on."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.verdicts import LAST, NOMINAL, START, group

from flea_diag.wire.messages.verdict_numbers import NUMBER_OF, verdict_numbers
from flea_diag.wire.records import AmbiguityGroup, Candidate, Outcome

FIXED = ("outcome", "level", "stale", "live", "episode", "step", "members", "dropped",
         "not_observable", "since_detection_s")  # fmt: skip


def told(verdict: AmbiguityGroup) -> dict[str, float]:
    numbers = verdict_numbers(verdict)
    assert numbers.stamp_ns == verdict.stamp_ns
    return dict(zip(numbers.names, numbers.values, strict=True))


def test_one_fault_with_its_size() -> None:
    jam = Candidate("jam", "jam+", 0.97, "fits", (), 118.5, 4.25, "N")
    found = told(replace(LAST, members=(jam,), stale=True))
    assert tuple(found)[: len(FIXED)] == FIXED
    assert (found["outcome"], found["level"], found["stale"], found["live"]) == (2, 2, 1, 1)
    assert (found["episode"], found["step"], found["members"], found["dropped"]) == (1, 3, 1, 1)
    assert found["since_detection_s"] == pytest.approx((LAST.stamp_ns - START) / 1e9)
    assert (found["probability/jam"], found["size/jam"], found["size_sigma/jam"]) == (
        0.97, 118.5, 4.25,
    )  # fmt: skip


def test_no_fault_and_no_number_where_nothing_is_known() -> None:
    found = told(replace(NOMINAL, source="replay"))
    assert tuple(found) == FIXED
    assert (found["outcome"], found["members"], found["live"]) == (0, 0, 0)
    assert math.isnan(found["since_detection_s"])
    assert "size/jam" not in told(group(Outcome.DETECTED, "jam", "spall"))


def test_each_outcome_has_a_number_of_its_own_that_never_changes() -> None:
    """Programs of others are compiled against these."""
    assert [NUMBER_OF[outcome] for outcome in Outcome] == list(range(len(Outcome)))
    assert [outcome.value for outcome in Outcome][:8] == [
        "NOMINAL", "DETECTED", "ISOLATED", "INDISTINGUISHABLE", "UNEXPLAINED", "NOT_OBSERVABLE",
        "MODEL_MISMATCH", "DATA_UNUSABLE",
    ]  # fmt: skip
