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

"""Whatever the plumbing does to a healthy run, no fault is called and the loss is counted."""

from __future__ import annotations

import numpy as np
import pytest
from support import in_turn, lossy

from flea_diag.configuration.component import make_pipeline
from flea_diag.configuration.stand import load_stand
from flea_diag.wire.records import DataQuality, Detection

PARTS = ("dropped", "delayed", "reordered")
"""What "everything" does at once."""
SEED, SEEDS = 7, {"set_forward": 1001}
"""The filter of that unit was off its track for a moment just before the clock leapt."""
NAMES = [name for name in lossy.DISTURBANCES if name not in PARTS]


@pytest.mark.parametrize("name", [*NAMES, *in_turn(PARTS, 3)])
def test_no_fault_is_called_and_what_was_lost_is_said(name: str) -> None:
    run = lossy.passed(name, SEEDS.get(name, SEED))
    assert (run.called, run.miscounted) == ((), ())


UNTIL_S = 8
"""Long enough to say them some times."""


def test_losses_are_said_while_they_happen() -> None:
    records = list(lossy.nominal(7))[: 100 * UNTIL_S]
    run = lossy.dropped(records, np.random.default_rng(1)).records
    pipeline = make_pipeline(load_stand())
    said = [r for record in run for r in pipeline.handle(record) if isinstance(r, DataQuality)]
    assert len(said) >= UNTIL_S - 2
    rows = [lossy.stream([record]) for record in said]
    lost = [dict(row.counters)["lost"] for row in rows]
    assert lost == sorted(lost)
    assert rows[-1].reason == f"{lost[-1]} lost"


def test_a_wrong_stamp_ends_no_episode() -> None:
    """The relay spoils a faulty run; the one detection stands to the end."""
    records = list(lossy.faulty(7))
    spoilt = lossy.wrong_stamps(records, np.random.default_rng(2)).records
    for run in (records, spoilt):
        found = [r.detected for r in lossy.diagnosed(run) if isinstance(r, Detection)]
        assert found == [True]
