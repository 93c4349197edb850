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

"""What of the last verdict belongs to the run that is being observed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support import stands

from flea_diag.stages.observer.takeover import Takeover, takeover
from flea_diag.wire.records import NEVER_NS, AmbiguityGroup, Outcome, UnitOffset

TOLERANCES = {"current_offset_a": 0.05}
FIRST_NS = stands.START_NS + 5_000_000_000


def verdict(learned_ns: int, episode: int, detected_ns: int) -> AmbiguityGroup:
    """A verdict that keeps one offset and perhaps an open episode."""
    return AmbiguityGroup(
        FIRST_NS, Outcome.DETECTED, episode, 0, 0, (), (), detected_ns, "", "", "live",
        offsets=(offset(learned_ns),),
    )  # fmt: skip


def offset(learned_ns: int) -> UnitOffset:
    return UnitOffset("current_offset_a", 0.1, 0.01, learned_ns)


BEFORE, WITHIN, LATER = stands.START_NS - 1, stands.START_NS, FIRST_NS


@pytest.mark.parametrize(
    ("learned_ns", "episode", "detected_ns", "expected"),
    [
        (WITHIN, 0, NEVER_NS, Takeover((offset(WITHIN),), 0, NEVER_NS)),
        (WITHIN, 3, WITHIN, Takeover((offset(WITHIN),), 3, WITHIN)),
        (BEFORE, 3, WITHIN, Takeover((), 3, WITHIN)),
        (WITHIN, 3, BEFORE, Takeover((offset(WITHIN),), 0, BEFORE)),
        (BEFORE, 3, BEFORE, None),
        (LATER, 3, LATER, None),
    ],
)
def test_only_what_lies_between_channel_table_and_first_scan_is_taken_over(
    learned_ns, episode, detected_ns, expected
):
    assert (
        takeover(verdict(learned_ns, episode, detected_ns), stands.table(), FIRST_NS, TOLERANCES)
        == expected
    )


def test_without_a_verdict_a_table_or_a_scan_nothing_is_taken_over():
    group = verdict(WITHIN, 3, WITHIN)
    assert takeover(None, stands.table(), FIRST_NS, TOLERANCES) is None
    assert takeover(group, None, FIRST_NS, TOLERANCES) is None
    assert takeover(group, stands.table(), None, TOLERANCES) is None


@pytest.mark.parametrize(
    "change",
    [
        {"value": math.nan},
        {"value": math.inf},
        {"value": 5.1},
        {"sigma": math.nan},
        {"sigma": -0.1},
        {"parameter": "no_such_parameter"},
    ],
)
def test_a_zero_that_no_unit_has_is_not_taken(change):
    damaged = replace(verdict(WITHIN, 0, NEVER_NS), offsets=(replace(offset(WITHIN), **change),))
    assert takeover(damaged, stands.table(), FIRST_NS, TOLERANCES) is None
