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

"""Scans out of order, lost or twice: what the observer makes of them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support import stands
from support.observer_scans import counters, decisions, healthy, jammed

from flea_diag.wire.records import DataQuality, Detection, Residual


@pytest.mark.slow
def test_duplicates_and_late_scans_change_nothing_but_the_counters():
    disturbed = []
    for k, scan in enumerate(jammed()):
        disturbed.append(scan)
        if k % 7 == 3:
            disturbed.append(replace(scan, values=(99.0,) * len(scan.values)))
        if k % 11 == 10:
            disturbed.append(jammed()[k - 5])
    stage, plain = stands.observer(), stands.observer()
    told = [
        [r for r in fed(each, run) if not isinstance(r, DataQuality)]
        for fed, each, run in ((stands.feed, stage, disturbed), (stands.replay, plain, jammed()))
    ]
    assert repr(told[0]) == repr(told[1])
    found = counters(stage, jammed()[-1], "sensors/slow")
    # What comes again is twice, however late; so is the last scan.
    assert found["duplicate"] == 1 + sum((k % 7 == 3) + (k % 11 == 10) for k in range(2000))
    assert found["late"] == found["lost"] == 0
    assert counters(plain, jammed()[-1], "sensors/slow") == {
        "samples": 2001, "lost": 0, "late": 0, "duplicate": 1, "crowded": 0, "elsewhere": 0,
        "jumps": 0, "steps": 0,
    }  # fmt: skip


@pytest.mark.slow
def test_a_jump_back_in_time_starts_afresh():
    stage = stands.observer()
    stands.replay(stage, jammed())
    again = stands.replay(stage, healthy())
    assert stands.of(Detection, again) == []
    # The first nine are not yet believed.
    fresh = stands.replay(stands.observer(), healthy()[9:])
    assert repr(stands.of(Residual, again)) == repr(stands.of(Residual, fresh))


def test_a_gap_empties_the_window_and_is_counted():
    stage = stands.observer()
    whole = healthy()
    out = stands.replay(stage, whole[:1000] + whole[1050:])
    assert counters(stage, whole[-1], "sensors/slow")["lost"] == 50
    after_gap = stands.of(Residual, out)[1000]
    assert math.isnan(after_gap.values[after_gap.names.index("parity_mechanical")])
    assert decisions(out) == []


@pytest.mark.slow
def test_a_few_lost_scans_raise_nothing():
    out = stands.replay(stands.observer(), [s for k, s in enumerate(healthy()) if k % 40 > 2])
    assert decisions(out) == []
