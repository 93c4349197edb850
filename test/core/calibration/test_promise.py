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

"""The rate of false alarms that recordings support, against the Poisson distribution itself."""

from __future__ import annotations

import math

import pytest
from scipy import stats

from flea_diag.core.calibration.promise import FalseAlarmPromise


@pytest.mark.parametrize("alarms", [0, 1, 5, 300])
def test_a_rate_at_the_bound_shows_so_few_alarms_in_one_case_of_twenty(alarms: int) -> None:
    promise = FalseAlarmPromise(0.1, 29, 0.24, alarms)
    expected = promise.supported_per_hour * 0.24
    assert stats.poisson.cdf(alarms, expected) == pytest.approx(0.05)


def test_a_quarter_of_an_hour_supports_twelve_an_hour_and_a_tenth_takes_thirty_hours() -> None:
    promise = FalseAlarmPromise(0.1, 29, 0.25)
    assert promise.supported_per_hour == pytest.approx(12.0, rel=0.01)
    assert promise.needed_hours == pytest.approx(30.0, rel=0.01)
    assert "0.1 false alarms per hour stated, at most 12 supported (95%, no" in promise.words()


def test_two_recordings_support_no_rate_and_the_number_needed_is_said() -> None:
    promise = FalseAlarmPromise(0.1, 2, 10.0)
    assert math.isinf(promise.supported_per_hour)
    assert promise.words().endswith("no rate supported: 2 nominal recordings, at least 3 needed")
