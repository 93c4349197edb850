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

"""Members of a group, by their evidence."""

from __future__ import annotations

import pytest

from flea_diag.stages.evidence.evidence_group import (
    COVERAGE,
    INEXACT,
    TOLD_WINDOWS,
    EvidenceGroup,
    patience,
)


def left(*steps: tuple[dict[str, float], int]) -> list[str]:
    """Members after these steps: nats of each fault, and windows since the onset."""
    group = EvidenceGroup()
    for nats, windows in steps:
        group.take(nats, float(windows))
    return list(group.shares)


def test_a_member_is_dropped_for_good_below_what_the_coverage_leaves() -> None:
    near, far = {"jam": 30.0, "bias": 26.0}, {"jam": 30.0, "bias": 24.0}
    assert left((near, 50)) == ["jam", "bias"]
    assert left((far, 50)) == ["jam"]
    assert left((far, 50), ({"jam": 30.0, "bias": 60.0}, 51)) == ["jam"]
    assert pytest.approx(0.01) == 1.0 - COVERAGE


def test_few_windows_must_part_two_faults_by_more() -> None:
    nats = {"jam": 30.0, "bias": 23.0}
    assert left((nats, 50)) == ["jam"]
    assert left((nats, TOLD_WINDOWS // 2)) == ["jam", "bias"]
    assert patience(TOLD_WINDOWS // 2) == 2.0


def test_a_share_of_a_large_evidence_parts_no_two_faults() -> None:
    """A load cell's bias and its scaling under a load that hardly varies."""
    assert left(({"scaling": 684.6, "bias": 679.0, "jam": 574.0}, 50)) == ["scaling", "bias"]
    assert left(({"scaling": 684.6, "bias": 684.6 * (1.0 - 2.0 * INEXACT)}, 50)) == ["scaling"]


def test_shares_are_those_of_the_members_that_are_left() -> None:
    group = EvidenceGroup()
    group.take({"jam": 30.0, "bias": 30.0, "drift": 0.0}, 50.0)
    assert group.shares == pytest.approx({"jam": 0.5, "bias": 0.5})
    assert list(group.shares) == ["bias", "jam"]
    assert 0.0 < group.dropped["drift"] < 1e-12
