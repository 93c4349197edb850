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

"""A nominal run that becomes a faulty one: seamless in motion and time, otherwise as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.stand_runs import fault, records

from flea_diag.errors import RecordingError
from flea_diag.tools.recordings.splice import splice
from flea_diag.wire.records import ChannelTable, Record, Scan, Truth

MARGIN_S = 6.0
NOMINAL = records(seed=1, duration_s=12.0)
JAMMED = records(seed=2, duration_s=12.0, start_s=1.4e9, **fault("jam", 0.0))
JOINED = splice(NOMINAL, JAMMED, MARGIN_S)


def scans(run: list[Record] | tuple[Record, ...]) -> list[Scan]:
    return [record for record in run if isinstance(record, Scan)]


def positions(run: list[Scan]) -> np.ndarray:
    return np.array([scan.value("actuator_position") for scan in run])


def join() -> int:
    """Index of the first scan of the faulty run."""
    (truth,) = (record for record in JOINED if isinstance(record, Truth))
    return next(k for k, s in enumerate(scans(JOINED)) if s.stamp_ns == truth.onset_ns)


def test_time_goes_on_without_a_gap() -> None:
    stamps = [scan.stamp_ns for scan in scans(JOINED)]
    assert set(np.diff(stamps)) == {10_000_000}
    assert isinstance(JOINED[0], ChannelTable)


def test_the_truth_begins_at_the_join() -> None:
    (truth,) = (record for record in JOINED if isinstance(record, Truth))
    assert truth.fault == "jam"
    assert truth.stamp_ns == truth.onset_ns
    assert join() * 0.01 >= MARGIN_S


def test_the_motion_has_no_seam() -> None:
    k, x = join(), positions(scans(JOINED))
    before, after = np.polyfit(range(10), x[k - 10 : k], 1), np.polyfit(range(10), x[k : k + 10], 1)
    assert np.sign(before[0]) == np.sign(after[0])
    # No more than the jump of a healthy run at the same speed, within the noise of the sensor.
    assert abs(x[k] - x[k - 1]) < abs(before[0]) + 5e-4


def test_all_readings_stay_as_they_were() -> None:
    k, joined = join(), scans(JOINED)
    assert joined[:k] == scans(NOMINAL)[:k]
    rest = [scan.values for scan in joined[k:]]
    assert rest == [scan.values for scan in scans(JAMMED)][-len(rest) :]
    assert len(rest) >= len(scans(JAMMED)) // 2


def test_runs_that_nowhere_meet_are_refused() -> None:
    far = [replace(s, values=tuple(v + 1.0 for v in s.values)) for s in scans(JAMMED)]
    with pytest.raises(RecordingError, match="never pass within 1 mm"):
        splice(NOMINAL, far, MARGIN_S)
    with pytest.raises(RecordingError, match="3 scans: too few for a join"):
        splice(NOMINAL, scans(JAMMED)[:3], MARGIN_S)
    with pytest.raises(RecordingError, match="never pass"):
        splice(NOMINAL, JAMMED, margin_s=60.0)
