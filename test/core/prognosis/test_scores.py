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

"""Scores of forecasts, by hand."""

from __future__ import annotations

from flea_diag.core.prognosis.scores import Foretold, at_lambda, horizon_s

END = 100.0


def test_right_to_a_share_of_what_is_left() -> None:
    made = Foretold(50.0, 40.0, 109.0, 130.0)
    assert made.is_within(END, 0.2), "59 left of 50"
    assert not Foretold(60.0, 40.0, 109.0, 130.0).is_within(END, 0.2), "49 left of 40"
    assert made.covers(END)
    assert not Foretold(50.0, 101.0, 109.0, 130.0).covers(END)


def test_lambda_counts_from_the_first_forecast() -> None:
    made = [Foretold(float(t), 90.0, 100.0, 110.0) for t in (20, 50, 60, 61, 90)]
    half = at_lambda(made, 20.0, END, 0.5)
    assert half is not None
    assert half.made_s == 60.0
    assert at_lambda(made, -100.0, END, 0.5) is None


def test_the_horizon_is_from_where_forecasts_stay_right() -> None:
    medians = {10.0: 100.0, 30.0: 140.0, 50.0: 115.0, 70.0: 95.0}
    made = [Foretold(t, 0.0, median, 200.0) for t, median in medians.items()]
    assert horizon_s(made, END, 0.2, END) == 50.0
    assert horizon_s(made, END, 0.01, END) == 0.0
