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

"""What of a stream of residuals the law of a recording takes."""

from __future__ import annotations

import numpy as np

from flea_diag.core.evidence.stream_windows import LawWindow
from flea_diag.core.residuals.stop import Stop
from flea_diag.core.run_law.run_windows import CURRENT_ZERO, FORMED, PLACE
from flea_diag.stages.evidence.stream_columns import StreamColumns
from flea_diag.wire.blocks import ResidualBlock

RELATIONS = ("balance", "circuit")
SIGNALS = ("current", "load", "way", "speed")
TABLE = (*SIGNALS, PLACE, "moving")
SCANS = 20


def windows(speed: float, place: float, moving: float = 1.0, side: str = "") -> list[LawWindow]:
    """Two windows of scans that are all alike."""
    stop = Stop(0.0, 0.1, 0.002, (PLACE,), {"balance": -1.0})
    acting = np.zeros((2, len(SIGNALS) + len(FORMED)), dtype=bool)
    columns = StreamColumns(
        RELATIONS, frozenset({"balance"}), (*SIGNALS, *FORMED), SIGNALS, {"speed": 1e-3},
        stop, (0.02, 0.08), 0.01, SCANS, side, acting=acting,
    )  # fmt: skip
    count = 2 * SCANS
    table = np.tile([0.0, 500.0, 1.0, speed, place, moving], (count, 1))
    values, none = np.ones((count, 2)), np.empty((count, 0))
    block = ResidualBlock(
        np.arange(count), RELATIONS, values, values, values, TABLE, table, (), none, none, none
    )
    return [window for _, window in columns.add(block)]


def test_a_balance_that_a_stop_may_enter_says_nothing_near_it() -> None:
    for place, known in ((0.05, [1.0, 1.0]), (0.0985, [np.nan, 1.0]), (0.001, [np.nan, 1.0])):
        for window in windows(0.02, place):
            np.testing.assert_allclose(window.values, known)


def test_at_rest_a_balance_says_nothing_and_under_a_push_it_is_a_standstill() -> None:
    rest, pushed, moving = windows(0.0, 0.05, 0.0)[0], windows(0.0, 0.05)[0], windows(0.02, 0.05)[0]
    np.testing.assert_allclose(rest.values, [np.nan, 1.0])
    assert [each.stands for each in (rest, pushed, moving)] == [False, True, False]


def test_load_and_way_come_with_where_along_the_healthy_travel() -> None:
    window = windows(0.02, 0.065)[0]
    np.testing.assert_allclose(window.signals[0, -4:], [250.0, -62.5, 0.5, -0.125])


def test_an_error_of_the_zero_of_the_current_acts_where_its_sign_is_not_whole() -> None:
    place = len(SIGNALS) + FORMED.index(CURRENT_ZERO)
    acts = [windows(0.02, 0.05, side=side)[0].signals[0, place] for side in ("", "current", "way")]
    np.testing.assert_allclose(acts, [0.0, 1.0, 0.0], atol=1e-12)
